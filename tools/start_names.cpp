#include "tools/start_names.h"

#include <map>

namespace sinew {
namespace {

const std::map<std::string, Start> kStarts = {{"auto", Start::automatic},      {"zero", Start::zero},
                                              {"previous", Start::previous},   {"linear", Start::linear},
                                              {"quadratic", Start::quadratic}, {"skinning", Start::skinning},
                                              {"subspace", Start::subspace},   {"fischer", Start::fischer}};

}  // namespace

std::vector<std::string> start_names() {
  std::vector<std::string> names;
  for (const auto& [name, start] : kStarts) names.push_back(name);
  return names;
}

Start start_named(const std::string& name) {
  return kStarts.at(name);
}

}  // namespace sinew
