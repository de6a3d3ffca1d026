#include "pipeline/tetgen_protocol.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>

#include "pipeline/volume_graph.h"
#include "pipeline/worker_process.h"
#include "samples/shapes.h"
#include "tests/pipeline/damage.h"

namespace sinew {
namespace {

using namespace tetgen_protocol;
using Eigen::Vector3d;

/// A folder of its own for each test, removed at the end.
class Tetgen : public testing::Test {
 protected:
  Tetgen() {
    std::string name = testing::TempDir() + "sinew-tetgen-XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~Tetgen() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& bytes) const {
    const std::string path = folder_ / name;
    std::ofstream(path, std::ios::binary) << bytes;
    chmod(path.c_str(), 0700);
    return path;
  }
  /// A worker that is a shell script.
  std::string script(const std::string& lines) const { return write("worker", "#!/bin/sh\n" + lines + "\n"); }
  /// A worker that reads its input and answers `bytes`.
  std::string answering(const std::string& bytes) const {
    return script("cat > /dev/null; cat '" + write("answer", bytes) + "'");
  }

  std::filesystem::path folder_;
};

/// Its box runs from -1 to 1, where the mesh is taken before it is sent: it is sent as it is.
const TriMesh& cube() {
  static const TriMesh mesh = samples::box({2, 2, 2}, 1);
  return mesh;
}

VolumeGraph fill(const TriMesh& mesh, const std::string& worker, double seconds = 20.0) {
  VolumeGraphOptions options;
  options.interior = Interior::tetgen;
  options.spacing = 0.4;
  options.tetgen_worker = worker;
  options.worker_seconds = seconds;
  ThreadTeam team(1);
  return build_volume_graph(mesh, Solid(mesh), options, team);
}

/// A right answer to cube(): its middle, and from there a tetrahedron to each triangle.
struct Answer {
  TetrahedraHeader header;
  std::vector<double> nodes;
  std::vector<std::int32_t> corners;

  Answer() {
    nodes.assign(cube().positions.data(), cube().positions.data() + cube().positions.size());
    nodes.insert(nodes.end(), {0.0, 0.0, 0.0});
    const std::int32_t middle = cube().vertex_count();
    for (const auto& triangle : cube().triangles) {
      corners.insert(corners.end(), {triangle[0], triangle[2], triangle[1], middle});
    }
    header = {static_cast<std::uint64_t>(middle) + 1, cube().triangles.size()};
  }
  std::string bytes() const {
    std::string text(kTetrahedraMagic);
    append(text, &header, 1);
    append(text, nodes.data(), nodes.size());
    append(text, corners.data(), corners.size());
    append_checksum(text);
    return text;
  }
};

std::string changed(const std::function<void(Answer&)>& change) {
  Answer answer;
  change(answer);
  return answer.bytes();
}

/// One warning that ends as expected, the same graph as the lattice's, and no process left behind.
void expect_fallback(const VolumeGraph& volume, const TriMesh& mesh, const std::string& reason) {
  ThreadTeam team(1);
  const VolumeGraph lattice = build_volume_graph(mesh, Solid(mesh), {.spacing = 0.4}, team);
  EXPECT_EQ(volume.interior, Interior::lattice);
  EXPECT_EQ(volume.graph.neighbors, lattice.graph.neighbors);
  EXPECT_EQ(volume.rest_positions, lattice.rest_positions);
  EXPECT_EQ(volume.spacing, 0.4);
  ASSERT_EQ(volume.warnings.size(), 1u);
  EXPECT_EQ(volume.warnings[0],
            "W_TETGEN_FALLBACK: the tetrahedra worker " + reason + "; the lattice fills the body instead");
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
  EXPECT_EQ(errno, ECHILD);
}

TEST_F(Tetgen, ARightAnswerIsTaken) {
  const VolumeGraph volume = fill(cube(), answering(Answer().bytes()));
  EXPECT_EQ(volume.interior, Interior::tetgen);
  EXPECT_TRUE(volume.warnings.empty()) << volume.warnings[0];
  EXPECT_EQ(volume.node_count(), 9);
  EXPECT_EQ(volume.graph.degree(8), 8);
  EXPECT_EQ(volume.graph.edge_count(), 18 + 8);
  EXPECT_NEAR(volume.spacing, std::sqrt(3.0), 1e-12);
}

TEST_F(Tetgen, AMissingWorkerIsSaidToBeMissing) {
  const std::string path = folder_ / "nowhere";
  expect_fallback(fill(cube(), path), cube(), "is not a program that can be run: " + path);
  const std::string text = write("text", "no program");
  chmod(text.c_str(), 0600);
  expect_fallback(fill(cube(), text), cube(), "is not a program that can be run: " + text);
}

TEST_F(Tetgen, AFileThatIsNoProgramCannotBeStarted) {
  expect_fallback(fill(cube(), write("data", std::string("\x01\x02\x03", 3))), cube(),
                  "could not be started");
}

TEST_F(Tetgen, ExitCodesAreToldWithTheFirstLineOfWhatTheWorkerSaid) {
  for (const int code : {1, 2, 3, 4, 5, 10, 200}) {
    const std::string end = "exit " + std::to_string(code);
    expect_fallback(fill(cube(), script(end)), cube(), "stopped with code " + std::to_string(code));
    expect_fallback(fill(cube(), script("cat > /dev/null; echo 'so it is' >&2; echo more >&2; " + end)),
                    cube(), "stopped with code " + std::to_string(code) + ": so it is");
  }
}

TEST_F(Tetgen, DeathByASignalIsToldByItsName) {
  expect_fallback(fill(cube(), script("kill -SEGV $$")), cube(), "was ended by a signal: Segmentation fault");
  expect_fallback(fill(cube(), script("kill -ABRT $$")), cube(), "was ended by a signal: Aborted");
}

TEST_F(Tetgen, AWorkerThatHangsIsEndedWithAllItStarted) {
  expect_fallback(fill(cube(), script("sleep 600"), 0.2), cube(), "took longer than 0.2 s");
  expect_fallback(fill(cube(), script("sleep 600 & trap '' TERM INT HUP; while :; do sleep 600; done"), 0.2),
                  cube(), "took longer than 0.2 s");
  expect_fallback(fill(cube(), script("exec > /dev/null 2> /dev/null < /dev/null; sleep 600"), 0.2), cube(),
                  "took longer than 0.2 s");
}

TEST_F(Tetgen, NothingThatTheWorkerStartedOutlivesIt) {
  const std::string fifo = folder_ / "fifo";
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  const int reader = open(fifo.c_str(), O_RDONLY | O_NONBLOCK);
  // The sleeper holds the fifo open for as long as it lives.
  fill(cube(), script("sleep 600 > '" + fifo + "' & echo up > '" + fifo + "'; wait"), 0.5);
  pollfd end = {reader, 0, 0};
  EXPECT_EQ(poll(&end, 1, 10'000), 1);
  EXPECT_TRUE(end.revents & POLLHUP);
  close(reader);
}

TEST_F(Tetgen, AWorkerThatLeavesAChildBehindIsNotWaitedForLonger) {
  EXPECT_EQ(
      fill(cube(), script("cat > /dev/null; sleep 600 & cat '" + write("answer", Answer().bytes()) + "'"))
          .interior,
      Interior::tetgen);
}

TEST_F(Tetgen, AWorkerThatDoesNotReadItsInputRaisesNoSignal) {
  const TriMesh large = samples::sphere(1.0, 5);  // more than a pipe holds
  expect_fallback(fill(large, script("exec < /dev/null; exit 3")), large, "stopped with code 3");
}

TEST_F(Tetgen, AWorkerThatEatsMemoryMeetsItsLimit) {
  const WorkerResult result = run_worker(script("ulimit -v"), "", {.seconds = 20.0, .megabytes = 512.0});
  EXPECT_EQ(result.failure, "");
  EXPECT_EQ(result.output, std::to_string(512 * 1024) + "\n");
}

TEST_F(Tetgen, AWorkerThatNeverStopsWritingMeetsItsLimit) {
  const WorkerResult result = run_worker(script("yes"), "", {.seconds = 20.0, .megabytes = 64.0});
  EXPECT_EQ(result.failure, "wrote more than its limit of 64 MB");
  EXPECT_EQ(result.output, "");
}

TEST_F(Tetgen, EveryTruncatedAnswerIsRefused) {
  const std::string whole = Answer().bytes();
  for (std::size_t length = 0; length < whole.size(); length += 1 + length / 16) {
    const VolumeGraph volume = fill(cube(), answering(whole.substr(0, length)));
    EXPECT_EQ(volume.interior, Interior::lattice) << length;
    EXPECT_EQ(volume.warnings.size(), 1u) << length;
  }
}

TEST_F(Tetgen, GarbageIsRefused) {
  expect_fallback(fill(cube(), script("cat > /dev/null; echo hello, here are your tetrahedra, enjoy them")),
                  cube(), "answered nonsense: not tetrahedra");
  expect_fallback(fill(cube(), answering(Answer().bytes() + "x")), cube(),
                  "answered nonsense: the sizes do not match");
  std::string flipped = Answer().bytes();
  flipped[30] = static_cast<char>(flipped[30] ^ 1);
  expect_fallback(fill(cube(), answering(flipped)), cube(), "answered nonsense: the checksum does not match");
}

TEST_F(Tetgen, HugeCountsAreRefusedBeforeMemoryIsTouched) {
  const std::uint64_t huge = std::uint64_t{1} << 62;
  expect_fallback(fill(cube(), answering(changed([&](Answer& a) { a.header.node_count = huge; }))), cube(),
                  "answered nonsense: 4611686018427387904 nodes, more than the limit of 20000008");
  expect_fallback(fill(cube(), answering(changed([&](Answer& a) { a.header.node_count = 10'000'000; }))),
                  cube(), "answered nonsense: the sizes do not match");
  expect_fallback(fill(cube(), answering(changed([&](Answer& a) { a.header.tetrahedron_count = huge; }))),
                  cube(), "answered nonsense: the sizes do not match");
}

TEST_F(Tetgen, WellFormedNonsenseIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto expect_refused = [&](const std::function<void(Answer&)>& change, const std::string& reason) {
    expect_fallback(fill(cube(), answering(changed(change))), cube(), "answered nonsense: " + reason);
  };
  expect_refused([&](Answer& a) { a.nodes[24] = nan; }, "a coordinate is not a finite number");
  expect_refused([&](Answer& a) { a.nodes[0] += 1e-9; }, "the surface is not the one that was sent");
  expect_refused([&](Answer& a) { a.corners[5] = 9; }, "a tetrahedron names a node that is not there");
  expect_refused([&](Answer& a) { a.corners[5] = -1; }, "a tetrahedron names a node that is not there");
  expect_refused([&](Answer& a) { std::swap(a.corners[4], a.corners[5]); },
                 "a tetrahedron is turned inside out");
  expect_refused(
      [&](Answer& a) {
        a.corners.resize(a.corners.size() - 4);
        --a.header.tetrahedron_count;
      },
      "the tetrahedra have 0.916667 times the volume inside the surface");
  expect_refused(
      [&](Answer& a) {
        a.nodes.insert(a.nodes.end(), {0.1, 0.1, 0.1});
        ++a.header.node_count;
      },
      "a node without a tetrahedron");
  expect_refused(
      [&](Answer& a) {
        a.corners.insert(a.corners.end(), {0, 0, 1, 2});
        ++a.header.tetrahedron_count;
      },
      "a tetrahedron names a node twice");
}

TEST_F(Tetgen, AnOpenSurfaceIsNotSent) {
  const TriMesh open = without_triangles(samples::sphere(1.0, 3), 0.1);
  expect_fallback(fill(open, script("exit 0")), open, "was not asked: the surface is not closed");
}

#ifdef SINEW_TETGEN_WORKER

TEST(TetgenWorker, FillsClosedShapesWithTetrahedraInsideThem) {
  for (const TriMesh& mesh :
       {samples::sphere(1.0, 3), samples::torus(1.0, 0.3, 48, 20), samples::arm(2.0, 0.2, 1.2, 16)}) {
    const Solid solid(mesh);
    ThreadTeam team(1);
    const VolumeGraph lattice = build_volume_graph(mesh, solid, {}, team);
    const VolumeGraph volume = build_volume_graph(
        mesh, solid, {.interior = Interior::tetgen, .tetgen_worker = SINEW_TETGEN_WORKER}, team);
    ASSERT_TRUE(volume.warnings.empty()) << volume.warnings[0];
    EXPECT_EQ(volume.interior, Interior::tetgen);
    EXPECT_EQ(volume.rest_positions.topRows(mesh.vertex_count()), mesh.positions);
    EXPECT_EQ(connected_components(volume.graph).count, 1);
    EXPECT_NEAR(volume.node_count(), lattice.node_count(), 0.25 * lattice.node_count());
    EXPECT_NEAR(volume.spacing / lattice.spacing, 1.0, 0.25);
    for (int node = volume.surface_count; node < volume.node_count(); ++node) {
      EXPECT_TRUE(solid.contains(volume.rest_positions.row(node)));
    }
  }
}

TEST(TetgenWorker, AnswersTheSameEachTime) {
  const TriMesh mesh = samples::arm(2.0, 0.2, 1.2, 16);
  const Solid solid(mesh);
  ThreadTeam team(1);
  const VolumeGraphOptions options = {.interior = Interior::tetgen, .tetgen_worker = SINEW_TETGEN_WORKER};
  const VolumeGraph first = build_volume_graph(mesh, solid, options, team);
  const VolumeGraph second = build_volume_graph(mesh, solid, options, team);
  EXPECT_EQ(first.graph.neighbors, second.graph.neighbors);
  EXPECT_EQ(first.rest_positions, second.rest_positions);
}

TEST(TetgenWorker, ASurfaceThatIntersectsItselfFallsBackToTheLattice) {
  const TriMesh mesh =
      joined(samples::sphere(1.0, 2), moved(samples::sphere(1.0, 2), 1.0, Vector3d(0.7, 0.1, 0.2)));
  ThreadTeam team(1);
  const VolumeGraph volume = build_volume_graph(
      mesh, Solid(mesh), {.interior = Interior::tetgen, .tetgen_worker = SINEW_TETGEN_WORKER}, team);
  EXPECT_EQ(volume.interior, Interior::lattice);
  ASSERT_EQ(volume.warnings.size(), 1u);
  EXPECT_EQ(volume.warnings[0].find("W_TETGEN_FALLBACK: the tetrahedra worker "), 0u) << volume.warnings[0];
}

TEST(TetgenWorker, RefusesWhatIsNotASurface) {
  const WorkerResult result = run_worker(SINEW_TETGEN_WORKER, "not a surface", {});
  EXPECT_EQ(result.failure, "stopped with code 10: TetGen cannot use this surface");
}

#endif

}  // namespace
}  // namespace sinew
