#include "pipeline/subspace.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "../solver/allocation_counter.h"
#include "arm_rig.h"
#include "pipeline/animate.h"
#include "pipeline/preview.h"
#include "pipeline/rotation_field.h"

namespace sinew {
namespace {

/// What is dropped of the modes, added up, and the tolerance of their solves.
constexpr double kDropped = 2e-4;

RigOptions subspace_options(Deform deform, SubspaceOf subspace, SolverKind solver = SolverKind::cholesky) {
  RigOptions options = arm_options(deform, solver);
  options.subspace = subspace;
  return options;
}

Field3 previewed(const Rig& rig, const Pose& pose, ThreadTeam& team) {
  Field3 positions(rig.volume.surface_count, 3);
  Preview(rig, team).answer(pose, positions);
  return positions;
}

Field3 surface_at_rest(const Rig& rig) {
  return rig.volume.rest_positions.topRows(rig.volume.surface_count);
}

class SubspaceForms : public testing::TestWithParam<Deform> {
 protected:
  Rig build(SubspaceOf subspace = SubspaceOf::surface) {
    return build_rig(arm_mesh(), arm_skeleton(), subspace_options(GetParam(), subspace), team_);
  }
  ThreadTeam team_{1};
};

TEST_P(SubspaceForms, the_rest_pose_gives_the_rest_mesh) {
  const Rig rig = build();
  EXPECT_LT(largest_difference(previewed(rig, rest_pose(rig.skeleton), team_), surface_at_rest(rig)),
            kDropped * rest_diagonal(rig.volume));
}

TEST_P(SubspaceForms, moving_the_whole_skeleton_moves_the_mesh_rigidly) {
  const Rig rig = build();
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond whole = turn(130, {1, 2, -1});
  const Eigen::Vector3d shift(30, -7, 12);
  const Field3 wanted =
      (surface_at_rest(rig) * whole.toRotationMatrix().transpose()).rowwise() + shift.transpose();
  EXPECT_LT(
      largest_difference(previewed(rig, posed(rig.skeleton, {whole, none, none}, shift), team_), wanted),
      kDropped * rest_diagonal(rig.volume));
}

TEST_P(SubspaceForms, a_pose_grown_by_half_grows_the_body_by_half) {
  const Rig rig = build();
  Pose pose = rest_pose(rig.skeleton);
  for (double& scale : pose.scales) scale = 1.5;
  for (Eigen::Vector3d& position : pose.positions) position *= 1.5;
  EXPECT_LT(largest_difference(previewed(rig, pose, team_), 1.5 * surface_at_rest(rig)),
            2.0 * kDropped * rest_diagonal(rig.volume));
}

/// The first solve of a frame, but with linear blends where it has rotations: assembled node by node.
Field3 solved_with_blends(const Rig& rig, const Pose& pose, const std::vector<Eigen::Matrix3d>& blends) {
  const auto rest = [&](int node) -> Eigen::Vector3d {
    return rig.volume.rest_positions.row(node).transpose();
  };
  Field3 answer = Field3::Zero(rig.volume.node_count(), 3);
  for (const SphereConstraint& sphere : rig.binding.spheres) {
    const Eigen::Vector3d arm = rest(sphere.node) - rig.skeleton.joints[sphere.joint].position;
    answer.row(sphere.node) = (pose.positions[sphere.joint] + blends[sphere.node] * arm).transpose();
  }
  for (const CoreConstraint& core : rig.binding.cores) {
    const int joint = rig.binding.bones[core.bone].joint;
    const Eigen::Vector3d axis_arm = core.foot - rig.skeleton.joints[joint].position;
    answer.row(core.node) = (pose.positions[joint] + pose.rotations[joint] * axis_arm +
                             blends[core.node] * (rest(core.node) - core.foot))
                                .transpose();
  }
  const Graph& graph = rig.volume.graph;
  Columns b = Columns::Zero(static_cast<Eigen::Index>(rig.node_of_free.size()), 3);
  for (int free = 0; free < b.rows(); ++free) {
    const int node = rig.node_of_free[free];
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      const int neighbor = graph.neighbors[k];
      const Eigen::Vector3d edge = rest(node) - rest(neighbor);
      b.row(free) += 0.5 * graph.weights[k] * ((blends[node] + blends[neighbor]) * edge).transpose();
      if (rig.free_of_node[neighbor] < 0) b.row(free) += graph.weights[k] * answer.row(neighbor);
    }
  }
  Columns x = Columns::Zero(b.rows(), 3);
  const auto workspace = rig.solver->make_workspace(3);
  rig.solver->solve(b, x, {}, *workspace);
  for (int free = 0; free < b.rows(); ++free) answer.row(rig.node_of_free[free]) = x.row(free);
  return answer;
}

TEST(Subspace, is_the_answer_with_linear_blends_for_rotations) {
  ThreadTeam team(1);
  const Rig rig =
      build_rig(arm_mesh(), arm_skeleton(), subspace_options(Deform::paper, SubspaceOf::surface), team);
  const Pose pose = bent_arm(100, 60);
  std::vector<Eigen::Matrix3d> blends(rig.volume.node_count(), Eigen::Matrix3d::Zero());
  for (int node = 0; node < rig.volume.node_count(); ++node) {
    for (int k = rig.harmonics.offsets[node]; k < rig.harmonics.offsets[node + 1]; ++k) {
      const Bone& bone = rig.binding.bones[rig.binding.fields[rig.harmonics.fields[k]].bone];
      blends[node] += rig.harmonics.weights[k] * pose.rotations[bone.joint].toRotationMatrix();
    }
  }
  const Field3 wanted = solved_with_blends(rig, pose, blends);
  EXPECT_LT(largest_difference(previewed(rig, pose, team), wanted.topRows(rig.volume.surface_count)),
            kDropped * rest_diagonal(rig.volume));
}

TEST(Subspace, interpolates_the_twist_of_a_bone_by_a_parabola) {
  ThreadTeam team(1);
  const Rig rig =
      build_rig(arm_mesh(), arm_skeleton(), subspace_options(Deform::refined, SubspaceOf::surface), team);
  ASSERT_FALSE(rig.binding.cores.empty());
  const Pose pose = bent_arm(70, 80);
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(pose);
  std::vector<Eigen::Matrix3d> blends(rig.volume.node_count(), Eigen::Matrix3d::Zero());
  std::vector<BlendTerm> terms;
  int twisted = 0;
  for (int node = 0; node < rig.volume.node_count(); ++node) {
    const int begin = rig.harmonics.offsets[node];
    terms.clear();
    rotations.append_terms(&rig.harmonics.fields[begin], &rig.harmonics.weights[begin],
                           rig.harmonics.offsets[node + 1] - begin, terms);
    for (const BlendTerm& term : terms) {
      const double share = term.weight;
      if (!rotations.turns()[term.turn].twists) {
        blends[node] += share * rotations.matrix_at(term.turn, 0.0f);
        continue;
      }
      ++twisted;
      const double t = term.along;
      blends[node] += share * ((1 - t) * (1 - 2 * t) * rotations.matrix_at(term.turn, 0.0f) +
                               4 * t * (1 - t) * rotations.matrix_at(term.turn, 0.5f) +
                               t * (2 * t - 1) * rotations.matrix_at(term.turn, 1.0f));
    }
  }
  EXPECT_GT(twisted, 0);
  const Field3 wanted = solved_with_blends(rig, pose, blends);
  EXPECT_LT(largest_difference(previewed(rig, pose, team), wanted.topRows(rig.volume.surface_count)),
            kDropped * rest_diagonal(rig.volume));
}

TEST_P(SubspaceForms, multigrid_gives_the_modes_of_the_direct_solver) {
  const Rig direct = build();
  const Rig multigrid =
      build_rig(arm_mesh(), arm_skeleton(),
                subspace_options(GetParam(), SubspaceOf::surface, SolverKind::multigrid), team_);
  const Pose pose = bent_arm(110, 70);
  EXPECT_LT(largest_difference(previewed(direct, pose, team_), previewed(multigrid, pose, team_)),
            kDropped * rest_diagonal(direct.volume));
}

TEST_P(SubspaceForms, one_and_two_threads_give_the_same_bytes) {
  ThreadTeam two(2);
  const Rig rig_two =
      build_rig(arm_mesh(), arm_skeleton(), subspace_options(GetParam(), SubspaceOf::surface), two);
  const Pose pose = bent_arm(100, 60);
  const Field3 one = previewed(build(), pose, team_);
  const Field3 other = previewed(rig_two, pose, two);
  EXPECT_EQ(std::memcmp(one.data(), other.data(), sizeof(double) * one.size()), 0);
}

TEST_P(SubspaceForms, some_rows_of_a_subspace_are_those_of_the_whole) {
  const Rig rig = build(SubspaceOf::free_nodes);
  const Subspace& all = *rig.subspace;
  std::vector<int> rows;
  for (int row = all.row_count() - 1; row >= 0; row -= 7) rows.push_back(row);
  const Subspace some(all, rows);
  PoseRotations rotations(rig.skeleton, rig.binding);
  const Pose pose = bent_arm(60, 30);
  rotations.read(pose);
  Eigen::VectorXf coordinates(all.coordinate_count());
  all.read(pose, rotations, coordinates);
  const auto evaluated = [&](const Subspace& subspace) {
    std::vector<Eigen::Vector4f> values(subspace.row_count());
    for (int block = 0; block < subspace.block_count(); ++block) {
      subspace.evaluate(block, coordinates, &values[static_cast<std::size_t>(block) * Subspace::kBlock]);
    }
    return values;
  };
  const std::vector<Eigen::Vector4f> whole = evaluated(all);
  const std::vector<Eigen::Vector4f> part = evaluated(some);
  for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_LT((part[k] - whole[rows[k]]).norm(), 1e-6) << k;
}

TEST_P(SubspaceForms, a_preview_allocates_nothing) {
  const Rig rig = build();
  Preview preview(rig, team_);
  Field3 positions(rig.volume.surface_count, 3);
  const Pose pose = bent_arm(60, 20);
  preview.answer(pose, positions);
  const long before = allocation_count();
  preview.answer(pose, positions);
  EXPECT_EQ(allocation_count(), before);
}

TEST_P(SubspaceForms, a_frame_that_starts_from_it_allocates_nothing) {
  const Rig rig = build(SubspaceOf::free_nodes);
  FrameOptions options;
  options.deform = GetParam();
  options.start = Start::subspace;
  FrameSolver solver(rig, options, team_);
  const Pose pose = bent_arm(90, 30), next = bent_arm(95, 40);
  const long before = allocation_count();
  for (int frame = 0; frame < 5; ++frame) solver.solve(frame % 2 == 0 ? pose : next);
  EXPECT_EQ(allocation_count(), before);
}

TEST_P(SubspaceForms, frames_that_start_from_it_have_the_answer_of_those_that_start_from_nothing) {
  RigOptions options = subspace_options(GetParam(), SubspaceOf::free_nodes, SolverKind::multigrid);
  options.volume.spacing = 0.02;
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), options, team_);
  const auto solved = [&](Start start) {
    FrameOptions frame;
    frame.deform = GetParam();
    frame.start = start;
    FrameSolver solver(rig, frame, team_);
    int cycles = 0;
    for (int k = 0; k < 12; ++k) {
      const FrameReport report = solver.solve(bent_arm(4.0 * k + 0.1 * k * k, 3.0 * k));
      EXPECT_TRUE(report.converged);
      cycles += report.cycles;
    }
    Field3 positions(rig.volume.node_count(), 3);
    solver.read_positions(positions);
    return std::pair(positions, cycles);
  };
  const auto [from_zero, zero_cycles] = solved(Start::zero);
  const auto [from_subspace, subspace_cycles] = solved(Start::subspace);
  EXPECT_LT(largest_difference(from_zero, from_subspace), 3e-4 * rest_diagonal(rig.volume));
  EXPECT_LT(subspace_cycles, zero_cycles);
  const auto [from_best, best_cycles] = solved(Start::automatic);
  EXPECT_LT(largest_difference(from_zero, from_best), 3e-4 * rest_diagonal(rig.volume));
}

INSTANTIATE_TEST_SUITE_P(BothForms, SubspaceForms, testing::Values(Deform::refined, Deform::paper),
                         [](const auto& form) { return form.param == Deform::paper ? "paper" : "refined"; });

TEST(Subspace, what_a_rig_lacks_is_refused) {
  ThreadTeam team(1);
  const auto message = [](const auto& act) -> std::string {
    try {
      act();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const Rig rig =
      build_rig(arm_mesh(), arm_skeleton(), subspace_options(Deform::paper, SubspaceOf::surface), team);
  FrameOptions options;
  options.start = Start::subspace;
  EXPECT_EQ(message([&] { FrameSolver(rig, options, team); }),
            "FrameSolver: the start is the subspace's; the rig has none of its free nodes");
  const Rig bare = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::paper), team);
  EXPECT_EQ(message([&] { Preview(bare, team); }), "Preview: the rig has no subspace of its surface");
  Field3 positions(rig.volume.surface_count, 3);
  EXPECT_EQ(message([&] { Preview(rig, team).answer(Pose{}, positions); }),
            "Preview::answer: got 0 joints; the rig has 3");
  Field3 few(3, 3);
  EXPECT_EQ(message([&] { Preview(rig, team).answer(bent_arm(10), few); }),
            "Preview::answer: got 3 rows; the surface has " + std::to_string(rig.volume.surface_count) +
                " vertices");
}

Motion bending() {
  Motion motion;
  motion.name = "bend";
  motion.frames_per_second = 30.0;
  for (int k = 0; k < 20; ++k) motion.poses.push_back(bent_arm(5.0 * k));
  return motion;
}

TEST(Preview, says_how_far_it_is_from_the_solved_frames) {
  ThreadTeam team(1);
  const Rig rig =
      build_rig(arm_mesh(), arm_skeleton(), subspace_options(Deform::refined, SubspaceOf::surface), team);
  const Motion motion = bending();
  FrameOptions options;
  options.tolerance = 1e-6;
  const PreviewError error = measure_preview(rig, motion, 2, 19, 3, options, team);
  EXPECT_EQ(error.frames, (std::vector<int>{5, 11, 17}));
  double largest = 0.0;
  for (const int frame : error.frames) {
    FrameSolver solver(rig, options, team);
    solver.solve(motion.poses[frame]);
    Field3 solved(rig.volume.surface_count, 3);
    solver.read_positions(solved);
    const Field3 shown = previewed(rig, motion.poses[frame], team);
    largest = std::max(largest, largest_difference(solved, shown) / rest_diagonal(rig.volume));
  }
  EXPECT_NEAR(error.largest, largest, 1e-5);
  EXPECT_EQ(error.worst_frame, 17);  // the more it bends the more a linear blend is off
  EXPECT_GT(error.rms, 0.0);
  EXPECT_LT(error.rms, error.largest);
  EXPECT_EQ(measure_preview(rig, motion, 4, 5, 9, options, team).frames, (std::vector<int>{4, 5}));
}

TEST(Preview, part_of_a_motion_has_the_bytes_of_the_whole) {
  ThreadTeam team(1);
  const Rig rig =
      build_rig(arm_mesh(), arm_skeleton(), subspace_options(Deform::paper, SubspaceOf::surface), team);
  const auto frames = [&](int first, int last) {
    std::vector<Field3> all;
    animate(rig, bending(), {.mode = FrameMode::preview, .first_frame = first, .last_frame = last}, team,
            [&](const FrameResult& result) {
              EXPECT_EQ(result.report.solves, 0);
              EXPECT_EQ(result.frame, first + static_cast<int>(all.size()));
              all.push_back(*result.positions);
              return true;
            });
    return all;
  };
  const std::vector<Field3> whole = frames(0, 19);
  const std::vector<Field3> part = frames(7, 12);
  ASSERT_EQ(whole.size(), 20u);
  ASSERT_EQ(part.size(), 6u);
  for (std::size_t k = 0; k < part.size(); ++k) {
    EXPECT_EQ(std::memcmp(part[k].data(), whole[7 + k].data(), sizeof(double) * part[k].size()), 0);
  }
}

}  // namespace
}  // namespace sinew
