#pragma once

#include <cstring>
#include <type_traits>
#include <utility>

/// Short vectors of any power of two of numbers, made of registers that this build's processor has. GCC's and
/// Clang's vector extension alone also takes vectors wider than a register, but GCC keeps those in memory:
/// every addition waits for a store to be read back.
namespace sinew {

#if defined(__AVX512F__)
constexpr int kRegisterBytes = 64;
#elif defined(__AVX__)
constexpr int kRegisterBytes = 32;
#else
constexpr int kRegisterBytes = 16;
#endif

/// Numbers in single precision that fill a register.
constexpr int kRegisterFloats = kRegisterBytes / static_cast<int>(sizeof(float));

template <typename Number, int kCount>
struct WideOf;

/// Twice as many numbers as in a `Half`, added and multiplied number by number as the extension's vectors
/// are.
template <typename Number, int kCount>
struct __attribute__((may_alias)) TwoHalves {
  using Half = typename WideOf<Number, kCount / 2>::Type;
  static constexpr int kHalf = kCount / 2;

  Half low, high;

  Number operator[](int k) const { return k < kHalf ? low[k] : high[k - kHalf]; }
  Number& operator[](int k) { return reinterpret_cast<Number*>(this)[k]; }

  TwoHalves operator-() const { return {-low, -high}; }
  TwoHalves& operator+=(const TwoHalves& other) { return *this = *this + other; }
  TwoHalves& operator-=(const TwoHalves& other) { return *this = *this - other; }
  template <typename Factor>
  TwoHalves& operator*=(const Factor& factor) {
    return *this = *this * factor;
  }

  friend TwoHalves operator+(const TwoHalves& a, const TwoHalves& b) {
    return {a.low + b.low, a.high + b.high};
  }
  friend TwoHalves operator-(const TwoHalves& a, const TwoHalves& b) {
    return {a.low - b.low, a.high - b.high};
  }
  friend TwoHalves operator*(const TwoHalves& a, const TwoHalves& b) {
    return {a.low * b.low, a.high * b.high};
  }
  friend TwoHalves operator*(const TwoHalves& a, Number factor) { return {a.low * factor, a.high * factor}; }
  friend TwoHalves operator*(Number factor, const TwoHalves& a) { return a * factor; }
};

template <typename Number, int kCount>
requires(kCount * sizeof(Number) <= kRegisterBytes) struct WideOf<Number, kCount> {
  typedef Number Type __attribute__((vector_size(kCount * sizeof(Number)), may_alias));
};
template <typename Number, int kCount>
requires(kCount * sizeof(Number) > kRegisterBytes) struct WideOf<Number, kCount> {
  using Type = TwoHalves<Number, kCount>;
};

/// kCount numbers.
template <typename Number, int kCount>
using Wide = typename WideOf<Number, kCount>::Type;

/// Whether a vector takes more than one register.
template <typename Vector>
constexpr bool kIsHalved = std::is_class_v<Vector>;

/// The numbers `first`, `first` + 1, ... of a register.
template <int first, typename Vector, int... kPlaces>
inline auto some_of(const Vector& v, std::integer_sequence<int, kPlaces...>) {
  return __builtin_shufflevector(v, v, (first + kPlaces)...);
}
template <typename Vector, int... kPlaces>
inline auto joined(const Vector& low, const Vector& high, std::integer_sequence<int, kPlaces...>) {
  return __builtin_shufflevector(low, high, kPlaces...);
}

/// The same numbers in another precision: `From` of `kCount` numbers as `To`.
template <typename ToNumber, int kCount, typename From>
inline Wide<ToNumber, kCount> converted(const From& v) {
  using To = Wide<ToNumber, kCount>;
  constexpr int kHalf = kCount / 2;
  constexpr bool to_is_halved = kCount * sizeof(ToNumber) > kRegisterBytes;
  if constexpr (kIsHalved<From> && to_is_halved) {
    return {converted<ToNumber, kHalf>(v.low), converted<ToNumber, kHalf>(v.high)};
  } else if constexpr (to_is_halved) {
    constexpr std::make_integer_sequence<int, kHalf> places;
    return {converted<ToNumber, kHalf>(some_of<0>(v, places)),
            converted<ToNumber, kHalf>(some_of<kHalf>(v, places))};
  } else if constexpr (kIsHalved<From>) {
    return joined(converted<ToNumber, kHalf>(v.low), converted<ToNumber, kHalf>(v.high),
                  std::make_integer_sequence<int, kCount>{});
  } else {
    return __builtin_convertvector(v, To);
  }
}

/// The k-th four numbers of sixteen.
template <int k, typename Vector>
inline Wide<float, 4> quarter(const Vector& v) {
  constexpr int fours = static_cast<int>(sizeof(Vector) / sizeof(Wide<float, 4>));
  if constexpr (fours == 1)
    return v;
  else if constexpr (!kIsHalved<Vector>)
    return some_of<4 * k>(v, std::make_integer_sequence<int, 4>{});
  else if constexpr (k < fours / 2)
    return quarter<k>(v.low);
  else
    return quarter<k - fours / 2>(v.high);
}

/// As many numbers from `numbers` on as the vector takes, aligned or not.
template <typename Vector, typename Number>
inline Vector loaded(const Number* numbers) {
  if constexpr (kIsHalved<Vector>) {
    using Half = typename Vector::Half;
    return {loaded<Half>(numbers), loaded<Half>(numbers + sizeof(Half) / sizeof(Number))};
  } else {
    Vector v;
    std::memcpy(&v, numbers, sizeof v);
    return v;
  }
}

/// The other way round. `numbers` aligned or not.
template <typename Vector, typename Number>
inline void store(const Vector& v, Number* numbers) {
  std::memcpy(numbers, &v, sizeof v);
}

/// Rows of four become columns.
inline void transpose(Wide<float, 4>& a, Wide<float, 4>& b, Wide<float, 4>& c, Wide<float, 4>& d) {
  const Wide<float, 4> ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Wide<float, 4> ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Wide<float, 4> cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Wide<float, 4> cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

/// Number by number: the size, and the larger of two (the second where they do not compare).
template <typename Vector>
inline Vector absolute(const Vector& v) {
  if constexpr (kIsHalved<Vector>)
    return {absolute(v.low), absolute(v.high)};
  else
    return v < 0 ? -v : v;
}
template <typename Vector>
inline Vector larger(const Vector& a, const Vector& b) {
  if constexpr (kIsHalved<Vector>)
    return {larger(a.low, b.low), larger(a.high, b.high)};
  else
    return a > b ? a : b;
}

}  // namespace sinew
