#include <iostream>
#include <sinew/io/bvh.h>
#include <sinew/io/gltf_writer.h>
#include <sinew/io/rig_file.h>
#include <sinew/pipeline/animate.h>

int main(int, char** argv) {
  const sinew::MeshAsset asset = sinew::read_mesh(argv[1]);
  const sinew::RigSkeleton skeleton = sinew::read_rig(argv[2]);
  const sinew::Motion motion = sinew::retarget(sinew::read_bvh(argv[3]), skeleton);
  sinew::ThreadTeam team;
  const sinew::Rig rig = sinew::build_rig(asset.mesh, skeleton, {}, team);
  sinew::GltfWriter writer(asset, {.frames_per_second = motion.frames_per_second});
  sinew::animate(rig, motion, {.last_frame = 2}, team,
                 [&](const sinew::FrameResult& frame) { return writer.add_frame(*frame.positions), true; });
  std::cout << writer.write(argv[4]).bytes << " bytes\n";
}
