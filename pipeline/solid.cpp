#include "pipeline/solid.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <tuple>

#include "pipeline/hole_lids.h"

// Winding numbers by signed crossings; after [Jacobson, Kavan, Sorkine-Hornung 2013] inside is where
// the winding number is not zero. Embree [Wald et al. 2014] finds the candidates.

namespace sinew {
namespace {

using Eigen::Vector3d;
using Triangle = std::array<int, 3>;

/// In the unit box. Single precision misplaces a point by up to 1e-7 there; rays are that much
/// longer at both ends and point queries that much wider, and double precision decides what counts.
constexpr double kSinglePrecision = 1e-6;

/// Share of a segment, at each end, on which crosses() looks away.
constexpr double kEndShare = 1e-6;

/// Lines that contains() may ask. Lines that agree are believed early, so this many are drawn only
/// where the surface is badly broken.
constexpr int kLineCount = 11;

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceRelease>;
using Scene = std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneRelease>;

/// Triangles that can be asked about, in the unit box.
struct TriangleSet {
  std::vector<Vector3d> points;
  std::vector<Triangle> triangles;
  std::vector<int> components;         ///< of each triangle
  std::vector<int> triangles_of_mesh;  ///< of each triangle; empty for lids
  Scene scene;

  const Vector3d& corner(unsigned triangle, int k) const { return points[triangles[triangle][k]]; }
  Vector3d normal(unsigned triangle) const {
    const Vector3d& a = corner(triangle, 0);
    return (corner(triangle, 1) - a).cross(corner(triangle, 2) - a);
  }
};

/// A segment of direction `along`, parametrised by length from `from`.
struct Segment {
  Vector3d from;
  Vector3d along;  ///< unit length
  double length = 0.0;
};

struct Hit {
  double at = 0.0;  ///< length along the segment
  int change = 0;
  unsigned triangle = 0;
};

/// Where the segment's line meets the plane of a triangle that the ray hits; none when parallel.
bool hit_plane(const TriangleSet& set, const Segment& segment, unsigned triangle, Hit& hit) {
  const Vector3d normal = set.normal(triangle);
  const double steepness = segment.along.dot(normal);
  if (steepness == 0.0) return false;
  hit.at = (set.corner(triangle, 0) - segment.from).dot(normal) / steepness;
  hit.change = steepness < 0.0 ? 1 : -1;
  hit.triangle = triangle;
  return true;
}

/// What an Embree filter needs: the context comes first, so that its address is the address of this.
struct RayQuery {
  RTCIntersectContext context;
  const TriangleSet* set = nullptr;
  const Segment* segment = nullptr;
  std::vector<Hit>* hits = nullptr;
};

unsigned candidate(const RTCFilterFunctionNArguments* arguments) {
  return RTCHitN_primID(arguments->hit, arguments->N, 0);
}

/// Keeps the hit and rejects it, so that the ray goes on to the next.
void collect_hit(const RTCFilterFunctionNArguments* arguments) {
  auto* query = reinterpret_cast<RayQuery*>(arguments->context);
  arguments->valid[0] = 0;
  Hit hit;
  if (!hit_plane(*query->set, *query->segment, candidate(arguments), hit)) return;
  if (hit.at > 0.0 && hit.at < query->segment->length) query->hits->push_back(hit);
}

/// Accepts the hit if it lies between the two ends in double precision too.
void confirm_crossing(const RTCFilterFunctionNArguments* arguments) {
  const auto* query = reinterpret_cast<const RayQuery*>(arguments->context);
  const Segment& segment = *query->segment;
  Hit hit;
  const bool between = hit_plane(*query->set, segment, candidate(arguments), hit) &&
                       hit.at > kEndShare * segment.length && hit.at < (1.0 - kEndShare) * segment.length;
  if (!between) arguments->valid[0] = 0;
}

RayQuery make_query(const TriangleSet& set, const Segment& segment, RTCFilterFunctionN filter) {
  RayQuery query;
  rtcInitIntersectContext(&query.context);
  query.context.filter = filter;
  query.set = &set;
  query.segment = &segment;
  return query;
}

RTCRay make_ray(const Segment& segment) {
  const Eigen::Vector3f origin = (segment.from - kSinglePrecision * segment.along).cast<float>();
  const Eigen::Vector3f direction = segment.along.cast<float>();
  RTCRay ray = {};
  ray.org_x = origin.x();
  ray.org_y = origin.y();
  ray.org_z = origin.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tfar = static_cast<float>(segment.length + 2.0 * kSinglePrecision);
  ray.mask = 0xffffffffu;
  return ray;
}

/// All hits along the open segment, in no particular order.
void collect_hits(const TriangleSet& set, const Segment& segment, std::vector<Hit>& hits) {
  hits.clear();
  if (!set.scene) return;
  RayQuery query = make_query(set, segment, collect_hit);
  query.hits = &hits;
  RTCRayHit ray = {};
  ray.ray = make_ray(segment);
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(set.scene.get(), &query.context, &ray);
}

/// Whether the segment, but for its very ends, meets a triangle.
bool meets(const TriangleSet& set, const Segment& segment) {
  if (!set.scene) return false;
  RayQuery query = make_query(set, segment, confirm_crossing);
  RTCRay ray = make_ray(segment);
  rtcOccluded1(set.scene.get(), &query.context, &ray);
  return ray.tfar < 0.0f;  // how Embree says that something was hit
}

Vector3d nearest_on_edge(const Vector3d& point, const Vector3d& a, const Vector3d& b) {
  const Vector3d edge = b - a;
  const double length = edge.squaredNorm();
  const double share = length > 0.0 ? std::clamp((point - a).dot(edge) / length, 0.0, 1.0) : 0.0;
  return a + share * edge;
}

Vector3d nearest_on_triangle(const Vector3d& point, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d normal = (b - a).cross(c - a);
  const double area = normal.squaredNorm();
  const bool over = area > 0.0 && (b - a).cross(point - a).dot(normal) >= 0.0 &&
                    (c - b).cross(point - b).dot(normal) >= 0.0 &&
                    (a - c).cross(point - c).dot(normal) >= 0.0;
  if (over) return point - (point - a).dot(normal) / area * normal;
  Vector3d best = nearest_on_edge(point, a, b);
  for (const Vector3d& other : {nearest_on_edge(point, b, c), nearest_on_edge(point, c, a)}) {
    if ((other - point).squaredNorm() < (best - point).squaredNorm()) best = other;
  }
  return best;
}

struct NearestQuery {
  const TriangleSet* set = nullptr;
  Vector3d point;
  double distance = 0.0;  ///< of the nearest found so far; at first, the limit
  Vector3d nearest;
  int triangle = -1;      ///< -1: nothing within the limit
  double widening = 0.0;  ///< what single precision may hide
};

bool visit_triangle(RTCPointQueryFunctionArguments* arguments) {
  auto& query = *static_cast<NearestQuery*>(arguments->userPtr);
  const unsigned id = arguments->primID;
  const Vector3d nearest = nearest_on_triangle(query.point, query.set->corner(id, 0),
                                               query.set->corner(id, 1), query.set->corner(id, 2));
  const double distance = (nearest - query.point).norm();
  const int triangle = static_cast<int>(id);
  // Of triangles equally near the first counts, whatever order Embree visits them in.
  if (distance > query.distance ||
      (distance == query.distance && query.triangle >= 0 && triangle > query.triangle)) {
    return false;
  }
  query.distance = distance;
  query.nearest = nearest;
  query.triangle = triangle;
  arguments->query->radius = static_cast<float>(distance + query.widening);
  return true;
}

void build_scene(RTCDevice device, TriangleSet& set) {
  if (set.triangles.empty()) return;
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), set.points.size()));
  auto* corners = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), set.triangles.size()));
  if (points == nullptr || corners == nullptr) throw std::bad_alloc();
  for (const Vector3d& point : set.points) {
    for (int axis = 0; axis < 3; ++axis) *points++ = static_cast<float>(point[axis]);
  }
  for (const Triangle& triangle : set.triangles) {
    for (const int vertex : triangle) *corners++ = static_cast<unsigned>(vertex);
  }
  rtcSetGeometryPointQueryFunction(geometry, visit_triangle);
  rtcCommitGeometry(geometry);
  set.scene.reset(rtcNewScene(device));
  // Robust: no ray slips between two triangles that share an edge.
  rtcSetSceneFlags(set.scene.get(), static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST |
                                                               RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  rtcAttachGeometry(set.scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(set.scene.get());
}

/// Component of each vertex, numbered by its smallest vertex among those that triangles use.
std::vector<int> components_of_vertices(int vertex_count, const std::vector<Triangle>& triangles) {
  std::vector<int> parent(vertex_count);
  for (int vertex = 0; vertex < vertex_count; ++vertex) parent[vertex] = vertex;
  const auto root = [&parent](int vertex) {
    while (parent[vertex] != vertex) vertex = parent[vertex] = parent[parent[vertex]];
    return vertex;
  };
  for (const Triangle& triangle : triangles) {
    for (int corner = 1; corner < 3; ++corner) {
      const int a = root(triangle[0]), b = root(triangle[corner]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<char> used(vertex_count, 0);
  for (const Triangle& triangle : triangles) {
    for (const int vertex : triangle) used[vertex] = 1;
  }
  std::vector<int> component(vertex_count, -1);
  int count = 0;
  for (int vertex = 0; vertex < vertex_count; ++vertex) {
    if (!used[vertex]) continue;
    const int first = root(vertex);
    component[vertex] = first == vertex ? count++ : component[first];
  }
  return component;
}

/// Triangles worth asking about: finite, and the first over their three vertices. Both faces of a
/// surface modelled from two sides would cancel in the winding number.
std::vector<int> usable_triangles(const TriMesh& mesh) {
  std::vector<std::tuple<int, int, int, int>> sorted;
  sorted.reserve(mesh.triangles.size());
  for (std::size_t index = 0; index < mesh.triangles.size(); ++index) {
    Triangle triangle = mesh.triangles[index];
    std::sort(triangle.begin(), triangle.end());
    if (triangle[0] < 0 || triangle[2] >= mesh.vertex_count()) {
      throw std::invalid_argument("Solid: triangle " + std::to_string(index) + " names vertex " +
                                  std::to_string(triangle[0] < 0 ? triangle[0] : triangle[2]) +
                                  "; expected 0 to " + std::to_string(mesh.vertex_count() - 1));
    }
    const bool finite = mesh.positions.row(triangle[0]).allFinite() &&
                        mesh.positions.row(triangle[1]).allFinite() &&
                        mesh.positions.row(triangle[2]).allFinite();
    if (finite) sorted.emplace_back(triangle[0], triangle[1], triangle[2], static_cast<int>(index));
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> usable;
  usable.reserve(sorted.size());
  for (std::size_t k = 0; k < sorted.size(); ++k) {
    const auto [a, b, c, index] = sorted[k];
    const bool first =
        k == 0 || std::tie(a, b, c) != std::tie(std::get<0>(sorted[k - 1]), std::get<1>(sorted[k - 1]),
                                                std::get<2>(sorted[k - 1]));
    if (first) usable.push_back(index);
  }
  std::sort(usable.begin(), usable.end());
  return usable;
}

/// Directions spread over half the sphere along a golden spiral: no two alike, none along an axis or
/// a diagonal, which modelled surfaces are full of.
std::array<Vector3d, kLineCount> line_directions() {
  std::array<Vector3d, kLineCount> directions;
  for (int k = 0; k < kLineCount; ++k) {
    // Every fourth place of the spiral, so that the first lines already differ much.
    const double height = ((k * 4) % kLineCount + 0.5) / kLineCount;
    const double turn = 2.0 * std::numbers::pi * (k / std::numbers::phi + 0.1);
    const double width = std::sqrt(1.0 - height * height);
    directions[k] = Vector3d(width * std::cos(turn), width * std::sin(turn), height);
  }
  return directions;
}

}  // namespace

struct Solid::Members {
  Device device;
  TriangleSet surface;
  TriangleSet lids;
  Vector3d middle = Vector3d::Zero();
  double half_size = 1.0;
  bool empty() const { return surface.triangles.empty(); }
  std::array<Vector3d, kLineCount> directions = line_directions();

  Vector3d to_unit(const Vector3d& point) const { return (point - middle) / half_size; }
  Vector3d from_unit(const Vector3d& point) const { return middle + half_size * point; }
  Segment unit_segment(const Vector3d& a, const Vector3d& b) const;
  NearestQuery find_nearest(const Vector3d& point, double limit) const;
  int vote(const Vector3d& point, const Vector3d& direction) const;
};

Segment Solid::Members::unit_segment(const Vector3d& a, const Vector3d& b) const {
  Segment segment{to_unit(a), (b - a) / half_size, 0.0};
  segment.length = segment.along.norm();
  if (segment.length > 0.0) segment.along /= segment.length;
  return segment;
}

NearestQuery Solid::Members::find_nearest(const Vector3d& point, double limit) const {
  NearestQuery found;
  found.set = &surface;
  found.point = to_unit(point);
  found.distance = limit / half_size;
  found.nearest = found.point;
  found.widening = kSinglePrecision * (1.0 + found.point.norm());
  if (empty()) return found;
  RTCPointQuery query = {};
  query.x = static_cast<float>(found.point.x());
  query.y = static_cast<float>(found.point.y());
  query.z = static_cast<float>(found.point.z());
  query.radius = static_cast<float>(found.distance + found.widening);
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(surface.scene.get(), &query, &context, visit_triangle, &found);
  return found;
}

/// Positive for inside, negative for outside, and the larger the surer: a line along which the
/// winding number comes back to 0 was counted right, one where it does not met a crack.
int Solid::Members::vote(const Vector3d& point, const Vector3d& direction) const {
  constexpr double kThroughTheBox = 4.0;  // longer than the diagonal of the unit box, from any point of it
  const Segment segment{point - kThroughTheBox * direction, direction, 2.0 * kThroughTheBox};
  thread_local std::vector<Hit> hits;
  int before = 0;
  int total = 0;
  for (const TriangleSet* set : {&surface, &lids}) {
    collect_hits(*set, segment, hits);
    for (const Hit& hit : hits) {
      if (hit.at < kThroughTheBox) before += hit.change;
      total += hit.change;
    }
  }
  const int weight = total == 0 ? 3 : 1;
  return before != 0 ? weight : -weight;
}

Solid::Solid(const TriMesh& mesh) : members_(std::make_unique<Members>()) {
  Members& m = *members_;
  TriangleSet& surface = m.surface;
  surface.triangles_of_mesh = usable_triangles(mesh);
  TriMesh usable{mesh.positions, {}};
  for (const int index : surface.triangles_of_mesh) usable.triangles.push_back(mesh.triangles[index]);
  const BoundingBox box = bounds(usable);
  m.middle = (box.low + box.high) / 2.0;
  m.half_size = (box.high - box.low).maxCoeff() / 2.0;
  if (!(m.half_size > 0.0)) m.half_size = 1.0;  // a single point, or nothing

  surface.points.resize(mesh.vertex_count());
  for (int vertex = 0; vertex < mesh.vertex_count(); ++vertex) {
    surface.points[vertex] = m.to_unit(mesh.positions.row(vertex));
  }
  const std::vector<int> component = components_of_vertices(mesh.vertex_count(), usable.triangles);
  const HoleLids lids = close_holes(usable);
  surface.triangles = std::move(usable.triangles);
  for (const Triangle& triangle : surface.triangles) surface.components.push_back(component[triangle[0]]);

  m.lids.triangles = lids.triangles;
  if (!lids.triangles.empty()) m.lids.points = surface.points;
  for (const Vector3d& middle : lids.middles) m.lids.points.push_back(m.to_unit(middle));
  for (const Triangle& lid : lids.triangles) m.lids.components.push_back(component[lid[0]]);

  // One thread: the order of triangles within Embree's tree is then the same in every run.
  m.device.reset(rtcNewDevice("threads=1"));
  if (!m.device) throw std::runtime_error("Solid: Embree cannot start on this machine");
  build_scene(m.device.get(), m.surface);
  build_scene(m.device.get(), m.lids);
}

Solid::~Solid() = default;
Solid::Solid(Solid&&) noexcept = default;
Solid& Solid::operator=(Solid&&) noexcept = default;

bool Solid::closed() const {
  return members_->lids.triangles.empty() && !members_->empty();
}

bool Solid::contains(const Vector3d& point) const {
  const Vector3d unit = members_->to_unit(point);
  const bool in_box = unit.cwiseAbs().maxCoeff() <= 1.0;  // false for a point that is not a number
  if (!in_box || members_->empty()) return false;
  constexpr int kEnough = 6;  // two sure lines
  int lead = 0;
  for (const Vector3d& direction : members_->directions) {
    lead += members_->vote(unit, direction);
    if (std::abs(lead) >= kEnough) break;
  }
  return lead > 0;
}

double Solid::distance(const Vector3d& point, double limit) const {
  const NearestQuery found = members_->find_nearest(point, limit);
  return found.triangle < 0 ? limit : found.distance * members_->half_size;
}

Vector3d Solid::nearest(const Vector3d& point) const {
  const NearestQuery found = members_->find_nearest(point, std::numeric_limits<double>::infinity());
  return found.triangle < 0 ? point : members_->from_unit(found.nearest);
}

bool Solid::crosses(const Vector3d& a, const Vector3d& b) const {
  const Segment segment = members_->unit_segment(a, b);
  if (!(segment.length > 0.0)) return false;
  return meets(members_->surface, segment) || meets(members_->lids, segment);
}

void Solid::crossings(const Vector3d& a, const Vector3d& b, std::vector<Crossing>& found) const {
  found.clear();
  const Segment segment = members_->unit_segment(a, b);
  if (!(segment.length > 0.0)) return;
  thread_local std::vector<Hit> hits;
  for (const TriangleSet* set : {&members_->surface, &members_->lids}) {
    collect_hits(*set, segment, hits);
    for (const Hit& hit : hits) {
      const int triangle = set->triangles_of_mesh.empty() ? -1 : set->triangles_of_mesh[hit.triangle];
      found.push_back({hit.at / segment.length, hit.change, triangle, set->components[hit.triangle]});
    }
  }
  std::sort(found.begin(), found.end(), [](const Crossing& left, const Crossing& right) {
    return std::tie(left.share, left.triangle, left.change) <
           std::tie(right.share, right.triangle, right.change);
  });
}

}  // namespace sinew
