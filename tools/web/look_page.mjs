// The page behind look.mjs: loads each file with three.js's own loader, poses it with its
// AnimationMixer, and draws the cells of the contact sheet.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { OBJLoader } from 'three/addons/loaders/OBJLoader.js';

const kFieldOfView = 25;      // degrees; narrow, so that proportions can be judged
const kBoxSamples = 13;       // moments that the box of the whole animation is taken from
const kBoxVertices = 3000;    // vertices a mesh of each such box
const kLabel = '13px sans-serif';

const kDirections = {
  front: [0, 0, 1], back: [0, 0, -1], side: [1, 0, 0], left: [1, 0, 0], right: [-1, 0, 0],
  top: [0, 1, 0.001], iso: [0.8, 0.55, 1],
};

async function load(url) {
  if (url.toLowerCase().endsWith('.obj')) return { scene: await new OBJLoader().loadAsync(url), animations: [] };
  const gltf = await new GLTFLoader().loadAsync(url);
  return { scene: gltf.scene, animations: gltf.animations };
}

/** Grey clay; back faces red, so that anything inside out shows. */
function clay(geometry) {
  const material = new THREE.MeshStandardMaterial({
    color: 0xb9b4ac, roughness: 0.75, side: THREE.DoubleSide, flatShading: !geometry.attributes.normal,
  });
  material.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace(
      '#include <color_fragment>',
      '#include <color_fragment>\nif (!gl_FrontFacing) diffuseColor.rgb = vec3(0.75, 0.12, 0.1);');
  };
  return material;
}

function dress(root, how) {
  const meshes = [];
  root.traverse((object) => {
    if (object.isMesh) meshes.push(object);
  });
  for (const mesh of meshes) {
    mesh.frustumCulled = false;  // its bounds know nothing of the animation
    if (!how.materials) mesh.material = clay(mesh.geometry);
    if (how.wire) for (const material of [mesh.material].flat()) material.wireframe = true;
  }
  return meshes;
}

/** Box of the meshes as posed now, from a share of their vertices. Hidden (zero-scaled) meshes do not count. */
function posedBox(root, meshes) {
  root.updateMatrixWorld(true);
  const box = new THREE.Box3();
  const point = new THREE.Vector3();
  for (const mesh of meshes) {
    if (Math.abs(mesh.matrixWorld.determinant()) < 1e-30) continue;
    const count = mesh.geometry.attributes.position.count;
    const step = Math.max(1, Math.floor(count / kBoxVertices));
    for (let vertex = 0; vertex < count; vertex += step)
      box.expandByPoint(mesh.getVertexPosition(vertex, point).applyMatrix4(mesh.matrixWorld));
  }
  return box;
}

function makeCamera(direction, box, how) {
  const camera = new THREE.PerspectiveCamera(kFieldOfView, how.width / how.height, 0.01, 1000);
  const centre = box.getCenter(new THREE.Vector3());
  const towards = new THREE.Vector3(...direction).normalize();
  camera.position.copy(centre).add(towards);
  camera.lookAt(centre);
  camera.updateMatrixWorld();
  const half = box.getSize(new THREE.Vector3()).multiplyScalar(0.5);
  const extent = (column) => {
    const axis = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, column);
    return Math.abs(axis.x) * half.x + Math.abs(axis.y) * half.y + Math.abs(axis.z) * half.z;
  };
  const slope = Math.tan(THREE.MathUtils.degToRad(kFieldOfView / 2));
  const distance = (1.08 * Math.max(extent(1) / slope, extent(0) / (slope * camera.aspect)) + extent(2)) / how.zoom;
  camera.position.copy(centre).addScaledVector(towards, distance);
  camera.near = distance / 100;
  camera.far = distance * 20;
  camera.updateProjectionMatrix();
  return camera;
}

/** 1, 2 or 5 times a power of ten, near a tenth of `length`. */
function gridStep(length) {
  const power = 10 ** Math.floor(Math.log10(length / 10));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= length / 10);
}

function addGround(scene, floor, whole) {
  const size = whole.getSize(new THREE.Vector3());
  const centre = whole.getCenter(new THREE.Vector3());
  const step = gridStep(size.length());
  const cells = 2 * Math.ceil((0.75 * Math.max(size.x, size.z, size.y)) / step);
  const grid = new THREE.GridHelper(cells * step, cells, 0x667788, 0xa8b0b8);
  grid.position.set(Math.round(centre.x / step) * step, floor, Math.round(centre.z / step) * step);
  const axes = new THREE.AxesHelper(1.5 * step);
  axes.position.copy(grid.position).add(new THREE.Vector3(-0.5 * cells * step + step, 0.01 * step, 0.5 * cells * step - step));
  // Where the corner is out of the picture the axes at the grid's middle still tell the facing.
  const middle = new THREE.AxesHelper(step);
  middle.position.set(grid.position.x, floor + 0.01 * step, grid.position.z);
  scene.add(grid, axes, middle);
  return step;
}

function addLights(scene) {
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8078, 1.3));
  const key = new THREE.DirectionalLight(0xffffff, 1.9);
  key.position.set(0.6, 1, 0.8);
  const fill = new THREE.DirectionalLight(0xdde6ff, 0.8);
  fill.position.set(-1, 0.4, -0.5);
  scene.add(key, fill);
}

function pickAnimation(animations, wanted) {
  if (animations.length === 0) return null;
  return animations.find((clip) => clip.name === wanted) ?? animations[Number(wanted)] ?? animations[0];
}

/** One file, ready to be posed at any moment. */
async function stage(input, how) {
  const { scene: root, animations } = await load(input.url);
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xe9ecef);
  scene.add(root);
  const meshes = dress(root, how);
  addLights(scene);
  const clip = pickAnimation(animations, how.animation);
  const rest = posedBox(root, meshes);
  const mixer = new THREE.AnimationMixer(root);
  const duration = clip ? clip.duration : 0;
  if (clip) {
    const action = mixer.clipAction(clip);
    action.setLoop(THREE.LoopOnce);
    action.clampWhenFinished = true;
    action.play();
  }
  const pose = (seconds) => {
    // Back to the start first: an action that has run out would stay at its end.
    mixer.stopAllAction();
    if (clip) mixer.clipAction(clip).reset().play();
    mixer.setTime(Math.min(seconds, duration));
    root.updateMatrixWorld(true);
  };
  const whole = new THREE.Box3();
  let largest = new THREE.Vector3();
  for (let sample = 0; sample < (clip ? kBoxSamples : 1); ++sample) {
    pose((duration * sample) / (kBoxSamples - 1));
    const box = posedBox(root, meshes);
    whole.union(box);
    largest = largest.max(box.getSize(new THREE.Vector3()));
  }
  if (whole.isEmpty()) throw new Error(`${input.name}: nothing to draw`);
  const step = addGround(scene, rest.min.y, whole);
  if (how.skeleton) {
    const bones = new THREE.SkeletonHelper(root);
    bones.material.depthTest = false;
    scene.add(bones);
  }
  return { ...input, scene, root, meshes, clip, duration, pose, whole, largest, step, rest };
}

function describe(file) {
  const vertices = file.meshes.reduce((sum, mesh) => sum + mesh.geometry.attributes.position.count, 0);
  const targets = file.meshes.reduce((sum, mesh) => sum + (mesh.morphTargetInfluences?.length ?? 0), 0);
  const size = file.rest.getSize(new THREE.Vector3()).toArray().map((value) => value.toPrecision(3)).join(' x ');
  const motion = file.clip
    ? `animation '${file.clip.name}' ${file.duration.toFixed(3)} s, ${file.clip.tracks.length} tracks`
    : 'no animation';
  return `${file.name}: ${file.meshes.length} meshes, ${vertices} vertices, ${targets} morph targets, rest ${size}, ${motion}`;
}

function cellBox(file, how) {
  if (!how.follow) return file.whole;
  const centre = posedBox(file.root, file.meshes).getCenter(new THREE.Vector3());
  return new THREE.Box3().setFromCenterAndSize(centre, file.largest);
}

window.look = async (inputs, how) => {
  for (const view of how.views)
    if (!kDirections[view]) throw new Error(`view '${view}'; expected one of ${Object.keys(kDirections).join(', ')}`);
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setSize(how.width, how.height);
  const files = [];
  for (const input of inputs) files.push(await stage(input, how));

  const columns = Math.max(...files.map((file) => (file.clip ? (how.times ?? how.shares).length : 1)));
  const sheet = document.createElement('canvas');
  sheet.width = columns * how.width;
  sheet.height = files.length * how.views.length * how.height;
  const paper = sheet.getContext('2d');
  paper.fillStyle = '#e9ecef';
  paper.fillRect(0, 0, sheet.width, sheet.height);
  paper.font = kLabel;

  files.forEach((file, index) => {
    const moments = file.clip ? (how.times ?? how.shares.map((share) => share * file.duration)) : [0];
    moments.forEach((seconds, column) => {
      file.pose(seconds);
      how.views.forEach((view, row) => {
        const x = column * how.width;
        const y = (index * how.views.length + row) * how.height;
        renderer.render(file.scene, makeCamera(kDirections[view], cellBox(file, how), how));
        paper.drawImage(renderer.domElement, x, y);
        paper.strokeStyle = '#888';
        paper.strokeRect(x + 0.5, y + 0.5, how.width - 1, how.height - 1);
        paper.fillStyle = '#222';
        paper.fillText(`${file.name}  ${view}  t = ${seconds.toFixed(2)} s  grid ${file.step}`, x + 8, y + 18);
      });
    });
  });
  const trouble = renderer.getContext().getError();
  if (trouble !== 0) console.error(`WebGL error ${trouble}`);
  return { png: sheet.toDataURL('image/png'), width: sheet.width, height: sheet.height, lines: files.map(describe) };
};
