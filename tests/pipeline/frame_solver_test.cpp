#include "pipeline/frame_solver.h"

#include <gtest/gtest.h>

#include <cstring>

#include "../solver/allocation_counter.h"
#include "arm_rig.h"
#include "pipeline/rotation_field.h"
#include "pipeline/starts.h"

namespace sinew {
namespace {

FrameOptions exact(Deform deform, double tolerance = 1e-6) {
  FrameOptions options;
  options.deform = deform;
  options.tolerance = tolerance;
  return options;
}

Field3 positions_of(const Rig& rig, const FrameSolver& solver) {
  Field3 positions(rig.volume.node_count(), 3);
  solver.read_positions(positions);
  return positions;
}

Field3 solved(const Rig& rig, const FrameOptions& options, const Pose& pose, ThreadTeam& team) {
  FrameSolver solver(rig, options, team);
  const FrameReport report = solver.solve(pose);
  EXPECT_TRUE(report.converged) << report.error;
  return positions_of(rig, solver);
}

bool same_bytes(const Field3& a, const Field3& b) {
  return a.rows() == b.rows() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
}

/// Fine enough for several levels: one cycle is not exact.
RigOptions fine_options(Deform deform) {
  RigOptions options = arm_options(deform, SolverKind::multigrid);
  options.volume.spacing = 0.02;
  return options;
}

class FrameSolverForms : public testing::TestWithParam<Deform> {
 protected:
  Rig build(SolverKind kind = SolverKind::cholesky) {
    return build_rig(arm_mesh(), arm_skeleton(), arm_options(GetParam(), kind), team_);
  }
  ThreadTeam team_{1};
};

TEST_P(FrameSolverForms, the_rest_pose_gives_the_rest_mesh) {
  const Rig rig = build();
  const Field3 positions = solved(rig, exact(GetParam()), rest_pose(rig.skeleton), team_);
  EXPECT_LT(largest_difference(positions, rig.volume.rest_positions), 1e-6 * bounds(rig.mesh).diagonal());
}

TEST_P(FrameSolverForms, the_rest_pose_gives_the_rest_mesh_with_multigrid_too) {
  const Rig rig = build(SolverKind::multigrid);
  const Field3 positions = solved(rig, exact(GetParam()), rest_pose(rig.skeleton), team_);
  EXPECT_LT(largest_difference(positions, rig.volume.rest_positions), 1e-6 * bounds(rig.mesh).diagonal());
}

TEST_P(FrameSolverForms, moving_the_whole_skeleton_moves_the_mesh_rigidly) {
  const Rig rig = build();
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond whole = turn(130, {1, 2, -1});
  const Eigen::Vector3d shift(30, -7, 12);
  const Field3 positions =
      solved(rig, exact(GetParam()), posed(rig.skeleton, {whole, none, none}, shift), team_);
  const Field3 wanted =
      (rig.volume.rest_positions * whole.toRotationMatrix().transpose()).rowwise() + shift.transpose();
  EXPECT_LT(largest_difference(positions, wanted), 1e-6 * bounds(rig.mesh).diagonal());
}

TEST_P(FrameSolverForms, held_nodes_are_exactly_where_the_pose_puts_them) {
  const Rig rig = build();
  const Pose pose = bent_arm(100, 60);
  const Field3 positions = solved(rig, exact(GetParam()), pose, team_);
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(pose);
  RotationField field;
  blend_rotations(rig.harmonics, rotations, team_, field);
  const auto rest = [&](int node) -> Eigen::Vector3d {
    return rig.volume.rest_positions.row(node).transpose();
  };
  for (const SphereConstraint& sphere : rig.binding.spheres) {
    const Eigen::Vector3d arm = rest(sphere.node) - rig.skeleton.joints[sphere.joint].position;
    const Eigen::Vector3d wanted =
        pose.positions[sphere.joint] + field.rotations[sphere.node].cast<double>() * arm;
    EXPECT_LT((positions.row(sphere.node).transpose() - wanted).norm(), 1e-7);
  }
  for (const CoreConstraint& core : rig.binding.cores) {
    const int joint = rig.binding.bones[core.bone].joint;
    const Eigen::Vector3d axis_arm = core.foot - rig.skeleton.joints[joint].position;
    const Eigen::Vector3d wanted = pose.positions[joint] + pose.rotations[joint] * axis_arm +
                                   field.rotations[core.node].cast<double>() * (rest(core.node) - core.foot);
    EXPECT_LT((positions.row(core.node).transpose() - wanted).norm(), 1e-7);
  }
}

TEST_P(FrameSolverForms, scaling_the_mesh_scales_the_answer) {
  const Rig rig = build();
  const double scale = 250.0;
  TriMesh mesh = arm_mesh();
  mesh.positions *= scale;
  RigSkeleton skeleton = arm_skeleton();
  for (RigJoint& joint : skeleton.joints) joint.position *= scale;
  *skeleton.joints.back().tip *= scale;
  RigOptions options = arm_options(GetParam());
  options.volume.spacing *= scale;
  const Rig large = build_rig(mesh, skeleton, options, team_);
  ASSERT_EQ(large.volume.node_count(), rig.volume.node_count());
  Pose pose = bent_arm(80, 40);
  const Field3 small = solved(rig, exact(GetParam()), pose, team_);
  for (Eigen::Vector3d& position : pose.positions) position *= scale;
  EXPECT_LT(largest_difference(solved(large, exact(GetParam()), pose, team_), small * scale), 1e-5 * scale);
}

TEST_P(FrameSolverForms, multigrid_agrees_with_the_direct_solver) {
  const Rig direct = build();
  const Rig multigrid = build(SolverKind::multigrid);
  const Pose pose = bent_arm(110, 70);
  const Field3 a = solved(direct, exact(GetParam()), pose, team_);
  const Field3 b = solved(multigrid, exact(GetParam()), pose, team_);
  EXPECT_LT(largest_difference(a, b), 1e-5 * bounds(direct.mesh).diagonal());
}

TEST_P(FrameSolverForms, one_and_two_threads_give_the_same_bytes) {
  ThreadTeam two(2);
  const Rig rig_one = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  const Rig rig_two = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), two);
  const Pose pose = bent_arm(100, 60);
  EXPECT_TRUE(same_bytes(solved(rig_one, exact(GetParam(), 1e-4), pose, team_),
                         solved(rig_two, exact(GetParam(), 1e-4), pose, two)));
}

TEST_P(FrameSolverForms, a_frame_allocates_nothing) {
  for (const SolverKind kind : {SolverKind::multigrid, SolverKind::cholesky}) {
    const Rig rig = build(kind);
    for (const Start start : {Start::automatic, Start::skinning, Start::fischer}) {
      FrameOptions options = exact(GetParam(), 1e-4);
      options.start = start;
      FrameSolver solver(rig, options, team_);
      Field3 positions = rig.volume.rest_positions;
      const Pose pose = bent_arm(90, 30), next = bent_arm(95, 40);
      const long before = allocation_count();
      for (int frame = 0; frame < 5; ++frame) solver.solve(frame % 2 == 0 ? pose : next);
      solver.forget();
      solver.solve(pose);
      solver.read_positions(positions);
      EXPECT_EQ(allocation_count(), before);
    }
  }
}

TEST_P(FrameSolverForms, skinning_begins_a_rigid_motion_at_its_end) {
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.9, Eigen::Vector3d(1, 2, -1).normalized()));
  Pose pose = rest_pose(rig.skeleton);
  for (std::size_t joint = 0; joint < pose.positions.size(); ++joint) {
    pose.positions[joint] = turn * pose.positions[joint] + Eigen::Vector3d(3, -1, 2);
    pose.rotations[joint] = turn * pose.rotations[joint];
  }
  const auto cycles_of = [&](Start start) {
    FrameOptions options = exact(GetParam(), 1e-6);
    options.start = start;
    FrameSolver solver(rig, options, team_);
    const FrameReport report = solver.solve(pose);
    return report.cycles - report.solves;
  };
  EXPECT_EQ(cycles_of(Start::skinning), 0);
  EXPECT_EQ(cycles_of(Start::automatic), 0);
  EXPECT_GT(cycles_of(Start::zero), 0);
}

/// The largest move of a node in one degree, over the median of the sweep's degrees.
double worst_step(const Rig& rig, const FrameOptions& options, Pose (*pose_at)(double degrees),
                  ThreadTeam& team) {
  FrameSolver solver(rig, options, team);
  solver.solve(pose_at(0));
  Field3 positions = positions_of(rig, solver);
  std::vector<double> steps;
  for (int degrees = 1; degrees <= 300; ++degrees) {
    const Field3 before = positions;
    solver.solve(pose_at(degrees));
    positions = positions_of(rig, solver);
    steps.push_back(largest_difference(positions, before));
  }
  std::sort(steps.begin(), steps.end());
  return steps.back() / steps[steps.size() / 2];
}

TEST_P(FrameSolverForms, no_node_jumps_while_the_wrist_turns_to_300_degrees) {
  const Rig rig = build();
  EXPECT_LT(worst_step(
                rig, exact(GetParam()), [](double degrees) { return bent_arm(20, degrees); }, team_),
            3.0);
}

TEST_P(FrameSolverForms, no_node_jumps_while_the_elbow_bends_right_over) {
  const Rig rig = build();
  EXPECT_LT(worst_step(
                rig, exact(GetParam()), [](double degrees) { return bent_arm(degrees, 20); }, team_),
            3.0);
}

TEST_P(FrameSolverForms, a_part_without_bone_moves_rigidly_with_its_bone) {
  const TriMesh both = joined(arm_mesh(), moved(samples::sphere(0.05, 1), {0.9, 0.3, 0.0}));
  const Rig rig = build_rig(both, arm_skeleton(), arm_options(GetParam()), team_);
  EXPECT_TRUE(mentions(rig.warnings, "W_PART_GLUED"));
  const Pose pose = bent_arm(60, 20);
  const Field3 positions = solved(rig, exact(GetParam()), pose, team_);
  ASSERT_FALSE(rig.binding.glued.empty());
  for (const auto& [node, bone] : rig.binding.glued) {
    const Eigen::Vector3d arm = rig.volume.rest_positions.row(node).transpose() - Eigen::Vector3d(0.8, 0, 0);
    EXPECT_LT((positions.row(node).transpose() - pose.positions[2] - pose.rotations[2] * arm).norm(), 1e-13);
  }
}

TEST_P(FrameSolverForms, a_pose_grown_by_half_grows_the_body_by_half) {
  const Rig rig = build();
  Pose pose = rest_pose(rig.skeleton);
  for (Eigen::Vector3d& position : pose.positions) position *= 1.5;
  pose.scales.assign(3, 1.5);
  const Field3 positions = solved(rig, exact(GetParam()), pose, team_);
  EXPECT_LT(largest_difference(positions, 1.5 * rig.volume.rest_positions), 1e-6);
}

TEST_P(FrameSolverForms, the_answer_hardly_depends_on_where_it_starts) {
  const Rig rig = build(SolverKind::multigrid);
  const Pose pose = bent_arm(70, 20);
  const Field3 afresh = solved(rig, exact(GetParam()), pose, team_);
  for (const Start start : {Start::automatic, Start::zero, Start::previous, Start::linear, Start::quadratic,
                            Start::skinning, Start::fischer}) {
    FrameOptions options = exact(GetParam());
    options.start = start;
    FrameSolver solver(rig, options, team_);
    for (const double degrees : {0.0, 17.0, 39.0, 50.0}) solver.solve(bent_arm(degrees, 20));
    EXPECT_TRUE(solver.solve(pose).converged);
    EXPECT_LT(largest_difference(positions_of(rig, solver), afresh), 4e-6) << static_cast<int>(start);
  }
}

TEST_P(FrameSolverForms, after_forgetting_the_bytes_are_those_of_a_first_frame) {
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  FrameSolver solver(rig, exact(GetParam(), 1e-4), team_);
  const Field3 first = solved(rig, exact(GetParam(), 1e-4), bent_arm(70, 20), team_);
  for (const double degrees : {0.0, 17.0, 39.0, 50.0}) solver.solve(bent_arm(degrees, 20));
  solver.forget();
  solver.solve(bent_arm(70, 20));
  EXPECT_TRUE(same_bytes(positions_of(rig, solver), first));
}

TEST_P(FrameSolverForms, steady_motion_needs_fewer_cycles_than_frames_solved_from_nothing) {
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  const auto cycles_of = [&](Start start) {
    FrameOptions options = exact(GetParam(), 1e-5);
    options.start = start;
    FrameSolver solver(rig, options, team_);
    int cycles = 0;
    for (int frame = 0; frame < 20; ++frame) cycles += solver.solve(bent_arm(3.0 * frame, frame)).cycles;
    return cycles;
  };
  EXPECT_LT(cycles_of(Start::automatic), 0.7 * cycles_of(Start::zero));
  EXPECT_LT(cycles_of(Start::skinning), 0.8 * cycles_of(Start::zero));
  EXPECT_LT(cycles_of(Start::fischer), 0.8 * cycles_of(Start::zero));
}

TEST_P(FrameSolverForms, only_the_cycles_of_full_multigrid_are_counted_as_full) {
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  FrameOptions options = exact(GetParam(), 1e-6);
  options.start = Start::zero;
  FrameSolver solver(rig, options, team_);
  const FrameReport from_nothing = solver.solve(bent_arm(60, 20));
  // The first of every solve.
  EXPECT_EQ(from_nothing.full_cycles + from_nothing.whole_cycles, from_nothing.solves);
  EXPECT_GT(from_nothing.cycles, from_nothing.solves);
  options.start = Start::skinning;
  FrameSolver foreseeing(rig, options, team_);
  const FrameReport first = foreseeing.solve(bent_arm(58, 20));
  EXPECT_EQ(first.full_cycles + first.whole_cycles, from_nothing.solves);
  const FrameReport second = foreseeing.solve(bent_arm(60, 20));
  EXPECT_EQ(second.full_cycles + second.whole_cycles, 0);
}

TEST(FrameSolver, later_solves_of_slow_motion_take_light_cycles) {
  ThreadTeam team(1);
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(Deform::refined), team);
  FrameSolver solver(rig, exact(Deform::refined, 1e-4), team);
  FrameReport report;
  for (int frame = 0; frame < 8; ++frame) report = solver.solve(bent_arm(40 + 0.2 * frame, 20));
  EXPECT_EQ(report.light_cycles, report.solves - 1);
  EXPECT_TRUE(report.converged);
}

TEST(FrameSolver, earlier_solves_may_leave_what_does_not_reach_the_answer) {
  FrameOptions options = exact(Deform::refined);
  const auto allowed = [&] {
    std::vector<double> shares;
    for (int solve = 0; solve < solve_count(options); ++solve)
      shares.push_back(error_allowed(options, solve));
    return shares;
  };
  options.local_global = 2;
  EXPECT_EQ(allowed(), (std::vector<double>{4, 2, 1}));
  options.local_global = 0;
  EXPECT_EQ(allowed(), (std::vector<double>{1}));
  options.local_global = 40;
  ASSERT_EQ(allowed().size(), 41u);
  EXPECT_EQ(allowed().front(), 4) << "measured for two fits";
  options.deform = Deform::paper;
  EXPECT_EQ(allowed(), (std::vector<double>{1}));
}

TEST_P(FrameSolverForms, the_estimated_error_is_at_least_half_of_the_true_one) {
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  for (const double tolerance : {1e-2, 1e-4}) {
    FrameSolver loose(rig, exact(GetParam(), tolerance), team_);
    FrameSolver tight(rig, exact(GetParam()), team_);
    for (int frame = 0; frame < 20; ++frame) {
      const Pose pose = bent_arm(6.0 * frame, 40 * std::sin(frame));
      const FrameReport report = loose.solve(pose);
      tight.solve(pose);
      const double error = largest_difference(positions_of(rig, loose), positions_of(rig, tight));
      EXPECT_LE(error / rest_diagonal(rig.volume), 2 * report.error + 1e-6)
          << tolerance << ", frame " << frame;
    }
  }
}

TEST_P(FrameSolverForms, the_measured_residual_is_that_of_the_linear_system) {
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), fine_options(GetParam()), team_);
  FrameOptions options = exact(Deform::paper, 1e-3);
  options.measure_residual = true;
  FrameSolver solver(rig, options, team_);
  const Pose pose = bent_arm(100, 60);
  const double measured = solver.solve(pose).residual;
  const Field3 positions = positions_of(rig, solver);
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(pose);
  RotationField field;
  blend_rotations(rig.harmonics, rotations, team_, field);
  const Graph& graph = rig.volume.graph;
  double left = 0.0;
  double all = 0.0;
  for (const int node : rig.node_of_free) {
    Eigen::RowVector3d b = Eigen::RowVector3d::Zero();
    Eigen::RowVector3d residual = Eigen::RowVector3d::Zero();
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      const int other = graph.neighbors[k];
      const Eigen::Vector3d edge =
          (rig.volume.rest_positions.row(node) - rig.volume.rest_positions.row(other)).transpose();
      const Eigen::Quaterniond a = field.rotations[node].cast<double>();
      const Eigen::Quaterniond c = field.rotations[other].cast<double>();
      const Eigen::RowVector3d wanted = (0.5 * (a * edge + c * edge)).transpose();
      b += graph.weights[k] * wanted;
      residual += graph.weights[k] * (wanted - positions.row(node) + positions.row(other));
      if (rig.free_of_node[other] < 0) {
        b += graph.weights[k] * (positions.row(other) - pose.positions.front().transpose());
      }
    }
    left += residual.squaredNorm();
    all += b.squaredNorm();
  }
  EXPECT_NEAR(measured, std::sqrt(left / all), 0.01 * measured);
}

INSTANTIATE_TEST_SUITE_P(Forms, FrameSolverForms, testing::Values(Deform::refined, Deform::paper),
                         [](const auto& form) {
                           return form.param == Deform::refined ? "refined" : "paper";
                         });

TEST(FrameSolver, refined_keeps_bones_straight_and_volume_where_the_paper_lets_limbs_bow) {
  ThreadTeam team(1);
  const auto volume_after = [&](Deform deform) {
    const Rig rig = build_rig(arm_mesh(), arm_skeleton(), arm_options(deform), team);
    const Field3 positions = solved(rig, exact(deform), bent_arm(120), team);
    return enclosed_volume(rig.mesh, positions.topRows(rig.mesh.vertex_count())) /
           enclosed_volume(rig.mesh, rig.mesh.positions);
  };
  const double refined = volume_after(Deform::refined);
  EXPECT_GT(refined, volume_after(Deform::paper));
  EXPECT_GT(refined, 0.95);
}

TEST(FrameSolver, a_pose_of_another_skeleton_is_refused) {
  ThreadTeam team(1);
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::paper), team);
  FrameSolver solver(rig, exact(Deform::paper), team);
  Pose pose = rest_pose(rig.skeleton);
  pose.positions.pop_back();
  try {
    solver.solve(pose);
    FAIL() << "not refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "FrameSolver::solve: got 2 joints; the rig has 3");
  }
}

}  // namespace
}  // namespace sinew
