#include "io/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>

#include "tests/io/refusal.h"

namespace sinew {
namespace {

/// A folder of its own for each test, gone afterwards.
class AtomicFiles : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = testing::TempDir() + "sinew_atomic_XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string contents(const std::string& name) const {
    std::ifstream file(folder_ / name);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  long files() const {
    return std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator());
  }

  std::filesystem::path folder_;
};

TEST_F(AtomicFiles, appears_whole_at_commit_and_not_before) {
  AtomicFile file(folder_ / "a.txt");
  file.write(std::string_view("one "));
  file.write(std::string_view("two"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.txt"));
  file.commit();
  EXPECT_EQ(contents("a.txt"), "one two");
  EXPECT_EQ(files(), 1);
}

TEST_F(AtomicFiles, given_up_leaves_nothing_behind_and_the_old_file_as_it_was) {
  std::ofstream(folder_ / "a.txt") << "old";
  {
    AtomicFile file(folder_ / "a.txt");
    file.write(std::string_view("new"));
  }
  EXPECT_EQ(contents("a.txt"), "old");
  EXPECT_EQ(files(), 1);
}

TEST_F(AtomicFiles, takes_the_place_of_an_old_file) {
  std::ofstream(folder_ / "a.txt") << "a longer old text";
  AtomicFile file(folder_ / "a.txt");
  file.write(std::string_view("new"));
  file.commit();
  EXPECT_EQ(contents("a.txt"), "new");
}

TEST_F(AtomicFiles, cannot_take_the_place_of_a_folder) {
  std::filesystem::create_directory(folder_ / "a");
  const std::string message = refusal([&] {
    AtomicFile file(folder_ / "a");
    file.commit();
  });
  EXPECT_EQ(message, (folder_ / "a").string() + ": cannot rename into place: Is a directory");
  EXPECT_EQ(files(), 1);
}

TEST_F(AtomicFiles, reads_back_every_byte) {
  std::string bytes;
  for (int i = 0; i < 1000; ++i) bytes += static_cast<char>(i);
  AtomicFile file(folder_ / "a.bin");
  file.write(std::as_bytes(std::span(bytes.data(), bytes.size())));
  file.commit();
  const std::vector<std::byte> read = read_whole_file(folder_ / "a.bin", 1000);
  ASSERT_EQ(read.size(), 1000U);
  EXPECT_TRUE(std::equal(read.begin(), read.end(), std::as_bytes(std::span(bytes.data(), bytes.size())).begin()));
}

TEST_F(AtomicFiles, reading_refuses_what_is_too_large_before_reading_it) {
  std::ofstream(folder_ / "large.bin").close();
  std::filesystem::resize_file(folder_ / "large.bin", std::uintmax_t{1} << 40);  // all of it a hole
  EXPECT_EQ(refusal([&] { read_whole_file(folder_ / "large.bin", 100); }),
            (folder_ / "large.bin").string() + ": file has 1099511627776 bytes; at most 100 are read");
}

TEST_F(AtomicFiles, reading_refuses_folders_devices_and_pipes_without_waiting) {
  EXPECT_EQ(refusal([&] { read_whole_file(folder_, 100); }), folder_.string() + ": not a regular file");
  EXPECT_EQ(refusal([] { read_whole_file("/dev/zero", 100); }), "/dev/zero: not a regular file");
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(refusal([&] { read_whole_file(folder_ / "pipe", 100); }), (folder_ / "pipe").string() + ": not a regular file");
}

}  // namespace
}  // namespace sinew
