#include "io/rig_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "tests/io/refusal.h"

namespace sinew {
namespace {

const std::string kHead = "schema = \"sinew.rig/1\"\n";
const std::string kHips = "[[joint]]\nname = \"hips\"\nposition = [0, 1, 0]\n";

RigSkeleton parse(const std::string& text) { return parse_rig(text, "small.rig"); }
std::string refused(const std::string& text) {
  return refusal([&] { parse(text); });
}
/// The refusal of a rig of one joint with `line` added to it, as line 5.
std::string refused_joint(const std::string& line) { return refused(kHead + kHips + line + "\n"); }

void expect_same(const RigSkeleton& a, const RigSkeleton& b) {
  EXPECT_EQ(a.mesh, b.mesh);
  EXPECT_EQ(a.up, b.up);
  EXPECT_EQ(a.front, b.front);
  EXPECT_EQ(a.map, b.map);
  ASSERT_EQ(a.joint_count(), b.joint_count());
  for (std::size_t i = 0; i < a.joints.size(); ++i) {
    const RigJoint& x = a.joints[i];
    const RigJoint& y = b.joints[i];
    EXPECT_EQ(x.name, y.name);
    EXPECT_EQ(x.parent, y.parent);
    EXPECT_EQ(x.position, y.position);
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(std::signbit(x.position[axis]), std::signbit(y.position[axis]));
    EXPECT_EQ(x.role, y.role);
    EXPECT_EQ(x.tip, y.tip);
    EXPECT_EQ(x.cylinder_radius, y.cylinder_radius);
    EXPECT_EQ(x.sphere_radius, y.sphere_radius);
    ASSERT_EQ(x.helpers.size(), y.helpers.size());
    for (std::size_t h = 0; h < x.helpers.size(); ++h) {
      EXPECT_EQ(x.helpers[h].from, y.helpers[h].from);
      EXPECT_EQ(x.helpers[h].to, y.helpers[h].to);
    }
  }
}

TEST(ParseRig, reads_every_key) {
  const RigSkeleton rig = parse(kHead +
                                "mesh = \"man.obj\"\nup = \"+z\"\nfront = [0, -2, 0]\n" + kHips +
                                "role = \"hips\"\n"
                                "[[joint]]\nname = \"left hand\"\nparent = \"hips\"\nrole = \"left_hand\"\n"
                                "position = [0.5, 1e0, -0.25]\ntip = [0.7, 1, -0.25]\ncylinder_radius = 0.04\n"
                                "sphere_radius = 1\nhelpers = [ { from = [0, 0, 0], to = [1, 2, 3] }, ]\n"
                                "[map]\n\"left hand\" = \"mixamorig:LeftHand\"\nhips = \"mixamorig:Hips\"\n");
  EXPECT_EQ(rig.mesh, "man.obj");
  EXPECT_EQ(rig.up, Eigen::Vector3d::UnitZ());
  EXPECT_EQ(rig.front, Eigen::Vector3d(0, -2, 0));
  ASSERT_EQ(rig.joint_count(), 2);
  EXPECT_EQ(rig.joints[0].parent, -1);
  EXPECT_EQ(rig.joints[0].role, Role::hips);
  const RigJoint& hand = rig.joints[1];
  EXPECT_EQ(hand.name, "left hand");
  EXPECT_EQ(hand.parent, 0);
  EXPECT_EQ(hand.role, Role::left_hand);
  EXPECT_EQ(hand.position, Eigen::Vector3d(0.5, 1, -0.25));
  EXPECT_EQ(hand.tip, Eigen::Vector3d(0.7, 1, -0.25));
  EXPECT_EQ(hand.cylinder_radius, 0.04);
  EXPECT_EQ(hand.sphere_radius, 1.0);
  ASSERT_EQ(hand.helpers.size(), 1U);
  EXPECT_EQ(hand.helpers[0].to, Eigen::Vector3d(1, 2, 3));
  const std::vector<std::pair<std::string, std::string>> map = {{"left hand", "mixamorig:LeftHand"},
                                                                {"hips", "mixamorig:Hips"}};
  EXPECT_EQ(rig.map, map) << "in the file's order";
}

TEST(ParseRig, what_is_left_out_has_its_default) {
  const RigSkeleton rig = parse(kHead + kHips);
  EXPECT_EQ(rig.up, Eigen::Vector3d::UnitY());
  EXPECT_EQ(rig.front, Eigen::Vector3d::UnitZ());
  EXPECT_TRUE(rig.mesh.empty());
  EXPECT_FALSE(rig.joints[0].role || rig.joints[0].tip || rig.joints[0].cylinder_radius || rig.joints[0].sphere_radius);
}

TEST(ParseRig, joints_may_come_in_any_order_and_are_sorted_parents_first) {
  const auto joint = [](const std::string& name, const std::string& parent) {
    return "[[joint]]\nname = \"" + name + "\"\nposition = [0, 0, 0]\n" + (parent.empty() ? "" : "parent = \"" + parent + "\"\n");
  };
  const RigSkeleton rig = parse(kHead + joint("hand", "arm") + joint("foot", "hips") + joint("arm", "hips") + joint("hips", ""));
  std::vector<std::string> names;
  for (const RigJoint& j : rig.joints) names.push_back(j.name);
  EXPECT_EQ(names, (std::vector<std::string>{"hips", "arm", "hand", "foot"}));
  EXPECT_EQ(rig.parents(), (std::vector<int>{-1, 0, 1, 0}));
  EXPECT_NO_THROW(check_rig_skeleton(rig, "test"));
}

TEST(ToRigText, reads_back_as_the_same_rig_to_the_last_bit) {
  RigSkeleton rig;
  rig.mesh = "a \"quoted\" \\ name\t\x01 caf\xC3\xA9.obj";
  rig.up = Eigen::Vector3d(0, 0, -1);
  rig.front = Eigen::Vector3d(1.0 / 3.0, -5, 1e-9);
  RigJoint root;
  root.name = "a.b c";
  root.position = Eigen::Vector3d(-0.0, 9223372036854775808.0, 1e300);
  root.role = Role::hips;
  rig.joints.push_back(root);
  RigJoint leaf;
  leaf.name = "=";
  leaf.parent = 0;
  leaf.position = Eigen::Vector3d(0.1, 5e-324, M_PI);
  leaf.tip = Eigen::Vector3d(1, 2, 3);
  leaf.cylinder_radius = 1.0 / 7.0;
  leaf.sphere_radius = 100;
  leaf.helpers = {{Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(0.1, 0.2, 0.3)}, {Eigen::Vector3d(4, 5, 6), Eigen::Vector3d(7, 8, 9)}};
  rig.joints.push_back(leaf);
  rig.map = {{"a.b c", "Hips"}, {"=", "\n"}};
  expect_same(parse(to_rig_text(rig)), rig);
  EXPECT_EQ(to_rig_text(parse(to_rig_text(rig))), to_rig_text(rig));
}

TEST(ToRigText, refuses_a_rig_that_could_not_be_read_back) {
  RigSkeleton rig = parse(kHead + kHips);
  rig.joints.push_back(rig.joints[0]);
  EXPECT_THROW(to_rig_text(rig), std::invalid_argument) << "two joints of one name";
  rig.joints[1].name.clear();
  EXPECT_THROW(to_rig_text(rig), std::invalid_argument) << "a joint without a name";
}

TEST(ReadRig, the_rigs_that_come_with_the_samples_read_and_round_trip) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(SINEW_SOURCE_DIR) / "samples" / "rigs")) {
    if (entry.path().extension() != ".toml") continue;
    SCOPED_TRACE(entry.path().string());
    const RigSkeleton rig = read_rig(entry.path());
    EXPECT_GT(rig.joint_count(), 10);
    expect_same(parse(to_rig_text(rig)), rig);
    ++count;
  }
  EXPECT_GT(count, 0);
}

TEST(ParseRig, names_the_line_of_what_it_does_not_understand) {
  EXPECT_EQ(refused(""), "small.rig:1: key 'schema' is missing; expected schema = \"sinew.rig/1\"");
  EXPECT_EQ(refused("schema = \"sinew.rig/2\"\nnew = 1\n"), "small.rig:1: schema 'sinew.rig/2'; expected 'sinew.rig/1'");
  EXPECT_EQ(refused(kHead), "small.rig:1: there is no [[joint]]; a rig needs one or more");
  EXPECT_EQ(refused(kHead + "\njoint = 3\n"), "small.rig:3: joint is not a list of tables; expected [[joint]]");
  EXPECT_EQ(refused(kHead + "colour = 1\n" + kHips),
            "small.rig:2: unknown key 'colour'; expected one of schema, mesh, up, front, joint, map");
  EXPECT_EQ(refused(kHead + "up = \"y\"\n" + kHips), "small.rig:2: up is 'y'; expected +x, -x, +y, -y, +z, -z or [x, y, z]");
  EXPECT_EQ(refused(kHead + "up = [0, 0, 0]\n" + kHips), "small.rig:2: up has no length");
  EXPECT_EQ(refused(kHead + "front = \"-y\"\n" + kHips), "small.rig:2: up and front are parallel");
  EXPECT_EQ(refused(kHead + "mesh = 1\n" + kHips), "small.rig:2: mesh is not text in quotes");
  EXPECT_EQ(refused(kHead + kHips + "[map]\nhip = \"Hips\"\n"), "small.rig:6: map names 'hip', which is no joint of the rig");
  EXPECT_EQ(refused(kHead + kHips + "[map]\nhips = 1\n"), "small.rig:6: hips is not text in quotes");
}

TEST(ParseRig, names_the_line_of_a_wrong_joint) {
  EXPECT_EQ(refused(kHead + "[[joint]]\nposition = [0, 0, 0]\n"), "small.rig:2: key 'name' is missing");
  EXPECT_EQ(refused(kHead + "[[joint]]\nname = \"a\"\n"), "small.rig:2: key 'position' is missing");
  EXPECT_EQ(refused(kHead + "[[joint]]\nname = \"a\"\nposition = [0, 0]\n"),
            "small.rig:4: position is not three numbers [x, y, z]");
  EXPECT_EQ(refused(kHead + "[[joint]]\nname = \"a\"\nposition = [0, nan, 0]\n"),
            "small.rig:4: position is not a finite number");
  EXPECT_EQ(refused_joint("radius = 1"),
            "small.rig:5: unknown key 'radius'; expected one of name, parent, role, position, tip, cylinder_radius, "
            "sphere_radius, helpers");
  EXPECT_EQ(refused_joint("cylinder_radius = 0"), "small.rig:5: cylinder_radius is not positive");
  EXPECT_EQ(refused_joint("sphere_radius = inf"), "small.rig:5: sphere_radius is not a finite number");
  EXPECT_EQ(refused_joint("role = \"pelvis\"").substr(0, 68),
            "small.rig:5: unknown role 'pelvis'; expected one of hips, spine, che");
  EXPECT_EQ(refused_joint("parent = \"root\""), "small.rig:5: unknown parent 'root'; no joint has that name");
  EXPECT_EQ(refused_joint("parent = \"hips\""), "small.rig:2: joint 'hips' is its own ancestor");
  EXPECT_EQ(refused_joint("tip = \"up\""), "small.rig:5: tip is not three numbers [x, y, z]");
  EXPECT_EQ(refused_joint("helpers = [[0, 0, 0]]"),
            "small.rig:5: helpers is not a list of { from = [x, y, z], to = [x, y, z] }");
  EXPECT_EQ(refused_joint("helpers = [{ from = [0, 0, 0] }]"), "small.rig:5: key 'to' is missing");
  EXPECT_EQ(refused(kHead + kHips + kHips), "small.rig:6: a second joint named 'hips'");
  EXPECT_EQ(refused(kHead + kHips + "role = \"hips\"\n[[joint]]\nname = \"b\"\nrole = \"hips\"\nposition = [0, 0, 0]\n"),
            "small.rig:8: a second joint with role 'hips'; 'hips' has it");
}

TEST(ParseRig, refuses_a_circle_of_parents) {
  const std::string joint = "[[joint]]\nposition = [0, 0, 0]\n";
  EXPECT_EQ(refused(kHead + joint + "name = \"a\"\nparent = \"b\"\n" + joint + "name = \"b\"\nparent = \"a\"\n"),
            "small.rig:2: joint 'a' is its own ancestor");
}

TEST(ParseRig, names_the_line_of_broken_toml) {
  EXPECT_EQ(refused(kHead + "up = \n").substr(0, 13), "small.rig:2: ");
  EXPECT_EQ(refused(kHead + kHips + "name = \"again\"\n").substr(0, 13), "small.rig:5: ");
}

TEST(ParseRig, every_truncated_prefix_gives_a_rig_or_a_file_error) {
  const std::string text = kHead + "up = \"+y\"\n" + kHips + "tip = [0, 1.5, 0]\nhelpers = [ { from = [0, 0, 0], to = [1, 2, 3] } ]\n" +
                           "[map]\nhips = \"Hips\"\n";
  for (std::size_t size = 0; size < text.size(); ++size) {
    try {
      parse(text.substr(0, size));
    } catch (const FileError&) {
    }
  }
}

TEST(ParseRig, deep_nesting_is_refused) {
  EXPECT_NE(refused(kHead + "up = " + std::string(100'000, '[')), "accepted");
}

}  // namespace
}  // namespace sinew
