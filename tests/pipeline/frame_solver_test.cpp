#include "pipeline/frame_solver.h"

#include <gtest/gtest.h>

#include <cstring>

#include "../solver/allocation_counter.h"
#include "arm_rig.h"
#include "pipeline/rotation_field.h"

namespace sinew {
namespace {

FrameOptions exact(Deform deform, double tolerance = 1e-10) {
  FrameOptions options;
  options.deform = deform;
  options.solve.tolerance = tolerance;
  return options;
}

Field3 solved(const Rig& rig, const FrameOptions& options, const Pose& pose, ThreadTeam& team) {
  FrameSolver solver(rig, options, team);
  Field3 positions = rig.volume.rest_positions;
  const FrameReport report = solver.solve_afresh(pose, positions);
  EXPECT_TRUE(report.converged);
  return positions;
}

bool same_bytes(const Field3& a, const Field3& b) {
  return a.rows() == b.rows() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
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
  const Field3 positions = solved(rig, exact(GetParam(), 1e-8), rest_pose(rig.skeleton), team_);
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
  const auto rest = [&](int node) -> Eigen::Vector3d { return rig.volume.rest_positions.row(node).transpose(); };
  for (const SphereConstraint& sphere : rig.binding.spheres) {
    const Eigen::Vector3d arm = rest(sphere.node) - rig.skeleton.joints[sphere.joint].position;
    const Eigen::Vector3d wanted = pose.positions[sphere.joint] + field.rotations[sphere.node].cast<double>() * arm;
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
  const Field3 b = solved(multigrid, exact(GetParam(), 1e-7), pose, team_);
  EXPECT_LT(largest_difference(a, b), 1e-5 * bounds(direct.mesh).diagonal());
}

TEST_P(FrameSolverForms, one_and_two_threads_give_the_same_bytes) {
  ThreadTeam two(2);
  RigOptions options = arm_options(GetParam(), SolverKind::multigrid);
  options.volume.spacing = 0.02;
  const Rig rig_one = build_rig(arm_mesh(), arm_skeleton(), options, team_);
  const Rig rig_two = build_rig(arm_mesh(), arm_skeleton(), options, two);
  const Pose pose = bent_arm(100, 60);
  EXPECT_TRUE(same_bytes(solved(rig_one, exact(GetParam(), 1e-4), pose, team_),
                         solved(rig_two, exact(GetParam(), 1e-4), pose, two)));
}

TEST_P(FrameSolverForms, a_frame_allocates_nothing) {
  for (const SolverKind kind : {SolverKind::multigrid, SolverKind::cholesky}) {
    const Rig rig = build(kind);
    FrameSolver solver(rig, exact(GetParam(), 1e-4), team_);
    Field3 positions = rig.volume.rest_positions;
    const Pose pose = bent_arm(90, 30);
    solver.solve_afresh(pose, positions);
    const long before = allocation_count();
    solver.solve_afresh(pose, positions);
    solver.solve(pose, positions);
    EXPECT_EQ(allocation_count(), before);
  }
}

/// The largest move of a node in one degree, over the median of the sweep's degrees.
double worst_step(const Rig& rig, const FrameOptions& options, Pose (*pose_at)(double degrees), ThreadTeam& team) {
  FrameSolver solver(rig, options, team);
  Field3 positions = rig.volume.rest_positions;
  solver.solve_afresh(pose_at(0), positions);
  std::vector<double> steps;
  for (int degrees = 1; degrees <= 300; ++degrees) {
    const Field3 before = positions;
    solver.solve(pose_at(degrees), positions);
    steps.push_back(largest_difference(positions, before));
  }
  std::sort(steps.begin(), steps.end());
  return steps.back() / steps[steps.size() / 2];
}

TEST_P(FrameSolverForms, no_node_jumps_while_the_wrist_turns_to_300_degrees) {
  const Rig rig = build();
  EXPECT_LT(worst_step(rig, exact(GetParam()), [](double degrees) { return bent_arm(20, degrees); }, team_), 3.0);
}

TEST_P(FrameSolverForms, no_node_jumps_while_the_elbow_bends_right_over) {
  const Rig rig = build();
  EXPECT_LT(worst_step(rig, exact(GetParam()), [](double degrees) { return bent_arm(degrees, 20); }, team_), 3.0);
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

TEST_P(FrameSolverForms, the_answer_hardly_depends_on_the_guess) {
  const Rig rig = build(SolverKind::multigrid);
  const FrameOptions options = exact(GetParam(), 1e-8);
  const Pose pose = bent_arm(70, 20);
  const Field3 afresh = solved(rig, options, pose, team_);
  FrameSolver solver(rig, options, team_);
  Field3 positions = rig.volume.rest_positions;
  solver.solve(pose, positions);
  EXPECT_LT(largest_difference(positions, afresh), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Forms, FrameSolverForms, testing::Values(Deform::refined, Deform::paper),
                         [](const auto& form) { return form.param == Deform::refined ? "refined" : "paper"; });

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
  Field3 positions = rig.volume.rest_positions;
  try {
    solver.solve(pose, positions);
    FAIL() << "not refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("FrameSolver::solve: got 2 joints and "), std::string::npos);
  }
}

}  // namespace
}  // namespace sinew
