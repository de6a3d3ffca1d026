#include "pipeline/timing.h"

namespace sinew {

void TimingReport::add(const std::string& stage, double milliseconds) {
  for (auto& [name, total] : stages_) {
    if (name == stage) {
      total += milliseconds;
      return;
    }
  }
  stages_.emplace_back(stage, milliseconds);
}

double TimingReport::total() const {
  double sum = 0.0;
  for (const auto& stage : stages_) sum += stage.second;
  return sum;
}

}  // namespace sinew
