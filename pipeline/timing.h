#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace sinew {

/// Milliseconds by named stage, in the order first seen. A stage is timed by a scope object.
class TimingReport {
 public:
  class Scope {
   public:
    Scope(TimingReport& report, std::string stage)
        : report_(report), stage_(std::move(stage)), start_(std::chrono::steady_clock::now()) {}
    ~Scope() {
      const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start_;
      report_.add(stage_, took.count());
    }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    TimingReport& report_;
    std::string stage_;
    std::chrono::steady_clock::time_point start_;
  };

  [[nodiscard]] Scope time(std::string stage) { return Scope(*this, std::move(stage)); }
  void add(const std::string& stage, double milliseconds);
  const std::vector<std::pair<std::string, double>>& stages() const { return stages_; }
  double total() const;

 private:
  std::vector<std::pair<std::string, double>> stages_;
};

}  // namespace sinew
