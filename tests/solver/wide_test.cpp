#include "solver/wide.h"

#include <gtest/gtest.h>

#include <vector>

namespace sinew {
namespace {

/// Numbers that single precision holds exactly, so do their sums and products.
template <typename Number, int kCount>
Wide<Number, kCount> numbers(int seed) {
  Wide<Number, kCount> v{};
  for (int k = 0; k < kCount; ++k) v[k] = static_cast<Number>((7 * k + 3 * seed) % 23 - 11);
  return v;
}

template <typename Number, int kCount>
void expect_number_by_number() {
  const Wide<Number, kCount> a = numbers<Number, kCount>(1), b = numbers<Number, kCount>(2);
  const auto factor = static_cast<Number>(3);
  Wide<Number, kCount> sum = a, difference = a, scaled = a;
  sum += b;
  difference -= b;
  scaled *= factor;
  const Wide<Number, kCount> all = (a + b) * (a - b) + factor * a - b * factor, turned = -a;
  const Wide<Number, kCount> sizes = absolute(a), larger_ones = larger(a, b);
  for (int k = 0; k < kCount; ++k) {
    ASSERT_EQ(sum[k], a[k] + b[k]) << kCount << " " << k;
    ASSERT_EQ(difference[k], a[k] - b[k]) << kCount << " " << k;
    ASSERT_EQ(scaled[k], 3 * a[k]) << kCount << " " << k;
    ASSERT_EQ(all[k], (a[k] + b[k]) * (a[k] - b[k]) + 3 * a[k] - 3 * b[k]) << kCount << " " << k;
    ASSERT_EQ(turned[k], -a[k]) << kCount << " " << k;
    ASSERT_EQ(sizes[k], a[k] < 0 ? -a[k] : a[k]) << kCount << " " << k;
    ASSERT_EQ(larger_ones[k], a[k] > b[k] ? a[k] : b[k]) << kCount << " " << k;
  }
}

template <int kCount>
void expect_conversions_to_keep_numbers() {
  const Wide<float, kCount> single = numbers<float, kCount>(4);
  const Wide<double, kCount> twice = converted<double, kCount>(single);
  const Wide<float, kCount> back = converted<float, kCount>(twice);
  for (int k = 0; k < kCount; ++k) {
    ASSERT_EQ(twice[k], static_cast<double>(single[k])) << kCount << " " << k;
    ASSERT_EQ(back[k], single[k]) << kCount << " " << k;
  }
}

TEST(Wide, vectors_of_any_width_work_number_by_number) {
  expect_number_by_number<float, 4>();
  expect_number_by_number<float, 8>();
  expect_number_by_number<float, 16>();
  expect_number_by_number<float, 64>();
  expect_number_by_number<double, 4>();
  expect_number_by_number<double, 16>();
}

TEST(Wide, conversions_keep_the_numbers_in_their_places) {
  expect_conversions_to_keep_numbers<4>();
  expect_conversions_to_keep_numbers<8>();
  expect_conversions_to_keep_numbers<16>();
}

TEST(Wide, transposing_makes_rows_of_columns_and_stores_reach_their_places) {
  Wide<float, 4> rows[4];
  for (int row = 0; row < 4; ++row)
    for (int k = 0; k < 4; ++k) rows[row][k] = static_cast<float>(10 * row + k);
  transpose(rows[0], rows[1], rows[2], rows[3]);
  for (int row = 0; row < 4; ++row) {
    std::vector<float> memory(6, -1.0f);
    store(rows[row], memory.data() + 1);  // not aligned
    for (int k = 0; k < 4; ++k) ASSERT_EQ(memory[1 + k], static_cast<float>(10 * k + row));
    ASSERT_EQ(memory[0], -1.0f);
    ASSERT_EQ(memory[5], -1.0f);
  }
}

TEST(Wide, quarters_and_loads_find_their_numbers) {
  std::vector<float> memory(17);
  for (int k = 0; k < 17; ++k) memory[k] = static_cast<float>(k);
  const auto v = loaded<Wide<float, 16>>(memory.data() + 1);  // not aligned
  for (int k = 0; k < 4; ++k) {
    ASSERT_EQ(quarter<0>(v)[k], 1.0f + static_cast<float>(k));
    ASSERT_EQ(quarter<1>(v)[k], 5.0f + static_cast<float>(k));
    ASSERT_EQ(quarter<2>(v)[k], 9.0f + static_cast<float>(k));
    ASSERT_EQ(quarter<3>(v)[k], 13.0f + static_cast<float>(k));
  }
}

}  // namespace
}  // namespace sinew
