// The skeleton as the sensor saw it, in three dimensions, at the clock's time.
import {
  AmbientLight, Color, CylinderGeometry, DirectionalLight, GridHelper, InstancedMesh, Matrix4, MeshLambertMaterial, PerspectiveCamera,
  Quaternion, Scene, SphereGeometry, Spherical, Vector3, WebGLRenderer,
} from "three";
import { nearest } from "./plots.js";

/** Bones between neighbours; where a joint is missing, the next one of the chain takes its place. */
const CHAINS = [
  ["head", "neck", "spine_shoulder", "torso", "pelvis"],
  ...["left", "right"].flatMap((side) => [
    ["spine_shoulder|neck|torso", `${side}_shoulder`, `${side}_elbow`, `${side}_wrist`, `${side}_hand`, `${side}_hand_tip`],
    [`${side}_wrist|${side}_hand`, `${side}_thumb`],
    ["pelvis|torso", `${side}_hip`, `${side}_knee`, `${side}_ankle`, `${side}_foot`],
  ]),
  ["left_shoulder", "right_shoulder"],
  ["left_hip", "right_hip"],
];
const JOINT_RADIUS_M = 0.026;
const BONE_RADIUS_M = 0.011;
/** The axis of a cylinder. */
const UP = new Vector3(0, 1, 0);

/** Pairs of places in `joints` that a bone connects. */
export function bonesOf(joints) {
  const bones = new Map();
  for (const chain of CHAINS) {
    const present = chain.map((names) => names.split("|").find((name) => joints.includes(name))).filter(Boolean);
    for (let i = 1; i < present.length; i += 1) {
      const pair = [joints.indexOf(present[i - 1]), joints.indexOf(present[i])];
      if (pair[0] !== pair[1]) bones.set(pair.join("-"), pair);
    }
  }
  return [...bones.values()];
}

/** Makes the replay in `place`, which follows `clock`. */
export function makeReplay(place, track, clock) {
  let renderer;
  try {
    renderer = new WebGLRenderer({ antialias: true, alpha: true });
  } catch {
    place.textContent = "The replay needs WebGL, which this browser does not offer.";
    return;
  }
  const n = track.joints.length;
  const bones = bonesOf(track.joints);
  const { middle, lowest, size } = extent(track);
  const scene = new Scene();
  const camera = new PerspectiveCamera(40, 1, 0.05, 100);
  scene.add(new AmbientLight(0xffffff, 2));
  const light = new DirectionalLight(0xffffff, 1.5);
  light.position.set(1, 2, 3);
  scene.add(light);

  const spheres = new InstancedMesh(new SphereGeometry(JOINT_RADIUS_M, 12, 8), new MeshLambertMaterial(), n);
  spheres.frustumCulled = false;
  const rods = new InstancedMesh(new CylinderGeometry(BONE_RADIUS_M, BONE_RADIUS_M, 1, 8), new MeshLambertMaterial(), bones.length);
  rods.frustumCulled = false;
  scene.add(spheres, rods);
  let floor = null;

  // From where the sensor stood, which is at the origin; from the front where that cannot be told.
  const away = Math.hypot(middle.x, middle.z);
  const view = new Spherical(size * 1.9, Math.PI / 2.25, away > 0.5 ? Math.atan2(-middle.x, -middle.z) : 0);
  const label = document.createElement("p");
  label.className = "hint";
  label.textContent = "Replay as the sensor saw it. Drag to turn; arrow keys turn, + and − come nearer and go away.";
  const canvas = renderer.domElement;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-label", "Skeleton at the chosen time; arrow keys turn it, plus and minus change the distance");
  place.append(canvas, label);

  function paint() {
    const style = getComputedStyle(document.documentElement);
    const of = (name) => new Color(style.getPropertyValue(name).trim());
    const colour = { left: of("--left"), right: of("--right"), middle: of("--text") };
    const side = (name) => (name.startsWith("left") ? colour.left : name.startsWith("right") ? colour.right : colour.middle);
    track.joints.forEach((name, j) => spheres.setColorAt(j, side(name)));
    spheres.instanceColor.needsUpdate = true;
    bones.forEach(([, to], b) => rods.setColorAt(b, side(track.joints[to])));
    if (rods.instanceColor) rods.instanceColor.needsUpdate = true;
    if (floor) scene.remove(floor);
    floor = new GridHelper(4, 8, of("--grid"), of("--grid"));
    floor.position.set(middle.x, lowest, middle.z);
    scene.add(floor);
  }

  const matrix = new Matrix4();
  const nowhere = new Matrix4().makeScale(0, 0, 0);
  const turned = new Quaternion();
  function rod(p, q) {
    const [from, to] = [new Vector3(...p), new Vector3(...q)];
    const along = to.clone().sub(from);
    const length = along.length();
    turned.setFromUnitVectors(UP, length > 0 ? along.divideScalar(length) : UP);
    return matrix.compose(from.add(to).divideScalar(2), turned, new Vector3(1, Math.max(length, 1e-6), 1));
  }

  function pose(time) {
    const t = nearest(track.time_s, time) ?? 0;
    const at = (j) => {
      const [x, y, z] = track.positions_m.slice((t * n + j) * 3, (t * n + j) * 3 + 3);
      return x === null || y === null || z === null ? null : [x, y, z];
    };
    for (let j = 0; j < n; j += 1) {
      const p = at(j);
      spheres.setMatrixAt(j, p ? matrix.makeTranslation(...p) : nowhere);
    }
    spheres.instanceMatrix.needsUpdate = true;
    bones.forEach(([from, to], b) => {
      const [p, q] = [at(from), at(to)];
      // A bone whose end was lost is not drawn.
      rods.setMatrixAt(b, p && q ? rod(p, q) : nowhere);
    });
    rods.instanceMatrix.needsUpdate = true;
    canvas.dataset.time = String(track.time_s[t]);
    render();
  }

  function render() {
    camera.position.setFromSpherical(view).add(middle);
    camera.lookAt(middle);
    renderer.render(scene, camera);
  }

  function fit() {
    const width = Math.max(place.clientWidth, 200);
    const height = Math.round(Math.min(width * 1.15, 460));
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    render();
  }

  function turn(around, up, nearer) {
    view.theta += around;
    view.phi = Math.min(Math.max(view.phi + up, 0.1), Math.PI / 1.9);
    view.radius = Math.min(Math.max(view.radius * nearer, size * 0.7), size * 6);
    render();
  }

  const KEYS = { ArrowLeft: [-0.15, 0, 1], ArrowRight: [0.15, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1], "+": [0, 0, 0.9],
    "-": [0, 0, 1.1] };
  canvas.addEventListener("keydown", (event) => {
    if (!(event.key in KEYS)) return;
    event.preventDefault();
    turn(...KEYS[event.key]);
  });
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) turn(-event.movementX * 0.01, -event.movementY * 0.01, 1);
  });
  paint();
  pose(clock.time);
  fit();
  clock.listen(pose);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    paint();
    render();
  });
  new ResizeObserver(fit).observe(place);
}

/** Middle of all positions, the lowest of them, and how large the body is, metres. */
function extent(track) {
  const axes = [[], [], []];
  track.positions_m.forEach((value, i) => {
    if (value !== null) axes[i % 3].push(value);
  });
  const bound = (values, share) => values[Math.min(values.length - 1, Math.floor(values.length * share))] ?? 0;
  for (const axis of axes) axis.sort((a, b) => a - b);
  // A few wild points must not move the camera.
  const [low, high] = [axes.map((axis) => bound(axis, 0.005)), axes.map((axis) => bound(axis, 0.995))];
  const middle = new Vector3(...low.map((value, k) => (value + high[k]) / 2));
  return { middle, lowest: low[1], size: Math.max(0.8, ...high.map((value, k) => value - low[k])) };
}
