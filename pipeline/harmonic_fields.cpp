// Bounded harmonic fields as rotation weights: [Shi et al. 2006, section 2], after Zayer et al. 2005.
#include "pipeline/harmonic_fields.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "pipeline/free_system.h"
#include "solver/cholesky.h"
#include "solver/multigrid.h"

namespace sinew {
namespace {

/// Fields solved side by side. Wide enough to share the passes over the matrix, narrow enough that the
/// columns of a million nodes stay near 100 MB.
constexpr int kFieldsAtOnce = 8;

/// Below this many nodes a direct factorisation is quicker than setting up levels.
constexpr int kDirectBelow = 30'000;

/// A weight on its way into the rows.
struct Entry {
  int node = 0;
  int field = 0;
  float weight = 0.0f;
};

FreeNodes find_unknowns(const VolumeGraph& volume, const Binding& binding) {
  std::vector<bool> given(volume.node_count(), false);
  for (const FieldConstraint& constraint : binding.field_constraints) given[constraint.node] = true;
  for (const auto& [node, bone] : binding.glued) given[node] = true;
  return order_free_nodes(volume, given);
}

/// Given values flow in through the edges from constrained nodes to unknown ones.
Columns boundary_terms(const VolumeGraph& volume, const Binding& binding, const FreeNodes& unknowns,
                       int first_field, int count) {
  Columns b = Columns::Zero(unknowns.count(), count);
  for (const FieldConstraint& constraint : binding.field_constraints) {
    const int column = constraint.field - first_field;
    if (column < 0 || column >= count) continue;
    for (int k = volume.graph.offsets[constraint.node]; k < volume.graph.offsets[constraint.node + 1]; ++k) {
      const int unknown = unknowns.free_of_node[volume.graph.neighbors[k]];
      if (unknown >= 0) b(unknown, column) += volume.graph.weights[k] * constraint.value;
    }
  }
  return b;
}

void keep_worse(SolveReport& worst, const SolveReport& report, bool first) {
  worst.cycles = std::max(worst.cycles, report.cycles);
  worst.residual = std::max(worst.residual, report.residual);
  worst.converged = report.converged && (first || worst.converged);
}

void solve_unknowns(const VolumeGraph& volume, const Binding& binding, const HarmonicFieldOptions& options,
                    ThreadTeam& team, std::vector<Entry>& entries, SolveReport& worst) {
  const FreeNodes unknowns = find_unknowns(volume, binding);
  const int count = unknowns.count();
  worst.converged = true;
  if (count == 0) return;
  const LinearSystem system = free_system(volume, unknowns);
  std::unique_ptr<const LinearSolver> solver;
  if (count < kDirectBelow) {
    solver = std::make_unique<CholeskySolver>(system);
  } else {
    solver = std::make_unique<MultigridSolver>(system, MultigridOptions{}, team);
  }
  const int field_count = static_cast<int>(binding.fields.size());
  const auto workspace = solver->make_workspace(std::min(field_count, kFieldsAtOnce));
  for (int first = 0; first < field_count; first += kFieldsAtOnce) {
    const int width = std::min(kFieldsAtOnce, field_count - first);
    const Columns b = boundary_terms(volume, binding, unknowns, first, width);
    Columns x = Columns::Zero(count, width);
    const SolveOptions solve{.tolerance = options.tolerance, .from_zero = true};
    keep_worse(worst, solver->solve(b, x, solve, *workspace), first == 0);
    for (int unknown = 0; unknown < count; ++unknown) {
      for (int column = 0; column < width; ++column) {
        const double weight = std::clamp(x(unknown, column), 0.0, 1.0);  // bounded but for rounding
        if (weight < options.drop_below) continue;
        entries.push_back({unknowns.node_of_free[unknown], first + column, static_cast<float>(weight)});
      }
    }
  }
}

/// Nodes whose fields are given: by their bone's cylinder, or by the bone their part is glued to.
void add_given(const Binding& binding, std::vector<Entry>& entries) {
  for (const FieldConstraint& constraint : binding.field_constraints) {
    if (constraint.value > 0.0) {
      entries.push_back({constraint.node, constraint.field, static_cast<float>(constraint.value)});
    }
  }
  std::vector<int> first_field(binding.bones.size(), -1);
  for (int field = 0; field < static_cast<int>(binding.fields.size()); ++field) {
    int& first = first_field[binding.fields[field].bone];
    if (first < 0) first = field;
  }
  for (const auto& [node, bone] : binding.glued) entries.push_back({node, first_field[bone], 1.0f});
}

/// Entries sorted by node, then field, rows scaled to sum to one.
void gather_rows(const std::vector<Entry>& entries, int node_count, HarmonicFields& fields) {
  fields.offsets.assign(node_count + 1, 0);
  for (const Entry& entry : entries) ++fields.offsets[entry.node + 1];
  for (int node = 0; node < node_count; ++node) fields.offsets[node + 1] += fields.offsets[node];
  fields.fields.resize(entries.size());
  fields.weights.resize(entries.size());
  std::vector<int> next(fields.offsets.begin(), fields.offsets.end() - 1);
  for (const Entry& entry : entries) {  // fields come in ascending order for each node
    fields.fields[next[entry.node]] = entry.field;
    fields.weights[next[entry.node]++] = entry.weight;
  }
  for (int node = 0; node < node_count; ++node) {
    float sum = 0.0f;
    for (int k = fields.offsets[node]; k < fields.offsets[node + 1]; ++k) sum += fields.weights[k];
    for (int k = fields.offsets[node]; k < fields.offsets[node + 1]; ++k) fields.weights[k] /= sum;
  }
}

struct Shares {
  double parent = 0.0;
  double child = 0.0;
};

/// How much the nodes of a joint's sphere listen to the bones on its two sides.
std::vector<Shares> shares_at_joints(const RigSkeleton& skeleton, const Binding& binding,
                                     const HarmonicFields& fields) {
  std::vector<Shares> shares(skeleton.joints.size());
  for (const SphereConstraint& constraint : binding.spheres) {
    const int parent = skeleton.joints[constraint.joint].parent;
    for (int k = fields.offsets[constraint.node]; k < fields.offsets[constraint.node + 1]; ++k) {
      const int joint = binding.bones[binding.fields[fields.fields[k]].bone].joint;
      if (joint == constraint.joint) shares[constraint.joint].child += fields.weights[k];
      if (joint == parent) shares[constraint.joint].parent += fields.weights[k];
    }
  }
  return shares;
}

std::string two_decimals(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

}  // namespace

double HarmonicFields::weight(int node, int field) const {
  const auto begin = fields.begin() + offsets[node];
  const auto end = fields.begin() + offsets[node + 1];
  const auto found = std::lower_bound(begin, end, field);
  return found == end || *found != field ? 0.0 : weights[found - fields.begin()];
}

std::size_t HarmonicFields::bytes() const {
  return offsets.size() * sizeof(int) + fields.size() * sizeof(int) + weights.size() * sizeof(float);
}

HarmonicFields solve_harmonic_fields(const VolumeGraph& volume, const Binding& binding,
                                     const HarmonicFieldOptions& options, ThreadTeam& team) {
  HarmonicFields fields;
  fields.field_count = static_cast<int>(binding.fields.size());
  std::vector<Entry> entries;
  add_given(binding, entries);
  solve_unknowns(volume, binding, options, team, entries, fields.solve);
  gather_rows(entries, volume.node_count(), fields);
  if (!fields.solve.converged) {
    char text[128];
    std::snprintf(text, sizeof text, "W_FIELDS_LOOSE: harmonic fields stopped at a residual of %.1e; wanted %.1e",
                  fields.solve.residual, options.tolerance);
    fields.warnings.emplace_back(text);
  }
  return fields;
}

std::vector<std::string> unbalanced_joints(const RigSkeleton& skeleton, const Binding& binding,
                                           const HarmonicFields& fields) {
  constexpr double least = 0.25;
  std::vector<bool> turns(skeleton.joints.size(), false);
  for (const Bone& bone : binding.bones) turns[bone.joint] = true;
  const std::vector<Shares> shares = shares_at_joints(skeleton, binding, fields);
  std::vector<std::string> warnings;
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    const int parent = skeleton.joints[joint].parent;
    const double sum = shares[joint].parent + shares[joint].child;
    if (parent < 0 || !turns[joint] || !turns[parent] || !(sum > 0.0)) continue;
    const double child = shares[joint].child / sum;
    if (child >= least && child <= 1.0 - least) continue;
    warnings.push_back("W_JOINT_UNBALANCED: at joint '" + skeleton.joints[joint].name + "' the body listens to '" +
                       skeleton.joints[parent].name + "' by " + two_decimals(1.0 - child) + " and to '" +
                       skeleton.joints[joint].name + "' by " + two_decimals(child) +
                       "; a joint in the middle of the limb gives about 0.50 each");
  }
  return warnings;
}

}  // namespace sinew
