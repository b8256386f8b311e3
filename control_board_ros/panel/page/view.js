// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The robot in motion: as measured, its reference as a ghost, torque as colour, pushes as arrows.

import * as THREE from "three";
import { ColladaLoader } from "three/examples/jsm/loaders/ColladaLoader.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { button, h, icon } from "./dom.js";
import { Grasp } from "./grasp.js";
import { Push } from "./push.js";
import { OrbitControls } from "./vendor/OrbitControls.js";
import URDFLoader from "./vendor/URDFLoader.js";

const HIDDEN = 0.015; // rad or m: a ghost nearer than this to the robot is not drawn
const FOLLOWING = ["pos", "posd", "mix", "vel"]; // modes with a position reference
const EVERY = 30; // ms between drawings, at least
const CHECK = 500; // ms between looks whether the robot is in the picture
const FINE = 1e4; // steps in a rad or m that are told apart
const PROCESSORS = /swiftshader|llvmpipe|softpipe|software|basic render/i; // names of renderers without a graphics card
const COARSE = 0.5; // pixels that they draw for one of the screen, each way
const SHARE = 4; // a machine that draws slowly spends this part of its time on it: one of four

/** Whether this browser has no graphics card, so that processors draw what it shows. */
function drawnByProcessors() {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) throw new Error("this browser has no WebGL 2");
  const known = probe.getExtension("WEBGL_debug_renderer_info");
  const renderer = probe.getParameter(known ? known.UNMASKED_RENDERER_WEBGL : probe.RENDERER);
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return PROCESSORS.test(renderer);
}

/** The joints that move a part. */
function jointsAbove(part) {
  const names = [];
  for (let above = part.parent; above; above = above.parent) if (above.isURDFJoint) names.push(above.name);
  return names;
}

/** The wanted position of a joint: proposed, else its reference in modes that follow one, else measured. */
function wantedOf(joint) {
  return joint.proposed ?? (FOLLOWING.includes(joint.mode) ? joint.state.position_reference : joint.state.position);
}

/** The share of its torque limit that a joint gives, 0 to 1. */
function torqueShare(joint) {
  return Math.min(Math.abs(joint.state.torque || 0) / (joint.limits.torque || 100), 1);
}

/** All that is seen of a joint; as long as it stays the same nothing is drawn. */
function looks({ joint, position, wanted }) {
  const shares = [torqueShare(joint), joint.externalShare ?? 0].map((share) => Math.round(100 * share));
  return [Math.round(FINE * position), Math.round(FINE * wanted), joint.mode === "hwfa", ...shares].join(" ");
}

export class View {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
    this.key = "";
    this.robot = this.ghost = this.look = null;
    this.drawn = this.begun = this.cost = this.checked = 0;
    this.colours = new Map();
    this.pushes = new Map();
    this.placed = false;
    this.canvas = h("canvas", { "aria-label": "The robot in 3D: drag or arrow keys turn it, + and − zoom", role: "img",
      tabindex: "0" });
    this.note = h("p", { class: "hint" });
    this.showGhost = true;
    this.ghostButton = button("ghost", "Show the reference as a ghost", () => this.toggleGhost(), icon("ghost"),
      { "aria-pressed": "true", title: "Reference as a ghost" });
    this.fitButton = button("ghost", "Show the whole robot", () => this.fit(), icon("fit"),
      { title: "Reset the view" });
    this.dragButton = button("ghost", "Drag joints in the view", () => this.toggleDrag(), icon("hand"),
      { "aria-pressed": "false", title: "Drag joints: sets their targets" });
    element.replaceChildren(this.canvas,
      h("div", { class: "view-tools" }, this.dragButton, this.ghostButton, this.fitButton),
      h("div", { class: "scale", "aria-label": "Colour: share of the torque limit" }, "torque",
        h("span", { class: "ramp" }), "limit"), this.note);
    const coarse = drawnByProcessors();
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: !coarse, alpha: true });
    this.renderer.setPixelRatio(coarse ? COARSE : Math.min(devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => { this.drawn = 0; });
    this.controls.addEventListener("start", () => { this.placed = false; });
    this.canvas.addEventListener("keydown", (event) => this.turn(event));
    this.grasp = new Grasp(this);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 1.6));
    const sun = new THREE.DirectionalLight(0xffffff, 1.9);
    sun.position.set(1.5, -2, 3);
    this.scene.add(sun);
    this.grid = new THREE.Group();
    this.scene.add(this.grid);
    this.recolour();
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  recolour() {
    const line = getComputedStyle(document.documentElement).getPropertyValue("--line").trim();
    const grid = new THREE.GridHelper(3, 12, line, line);
    grid.rotation.x = Math.PI / 2;
    this.grid.clear();
    this.grid.add(grid);
    this.drawn = 0;
  }

  toggleGhost() {
    this.showGhost = !this.showGhost;
    this.ghostButton.setAttribute("aria-pressed", String(this.showGhost));
  }

  toggleDrag() {
    this.grasp.turn(!this.grasp.on);
    this.dragButton.setAttribute("aria-pressed", String(this.grasp.on));
  }

  /** Arrow keys turn the view, + and − zoom. */
  turn(event) {
    const way = this.camera.position.clone().sub(this.controls.target);
    const round = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key];
    const tilt = { ArrowUp: -0.1, ArrowDown: 0.1 }[event.key];
    const zoom = { "+": 0.9, "-": 1 / 0.9 }[event.key];
    if (round) way.applyAxisAngle(this.camera.up, round);
    else if (tilt) {
      const end = way.angleTo(this.camera.up) + tilt;
      way.applyAxisAngle(new THREE.Vector3().crossVectors(this.camera.up, way).normalize(),
        end > 0.05 && end < 3.09 ? tilt : 0);
    } else if (zoom) way.multiplyScalar(zoom);
    else return;
    event.preventDefault();
    this.placed = false;
    this.camera.position.copy(this.controls.target).add(way);
    this.controls.update();
    this.drawn = 0;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.placed) this.fit();
    this.drawn = 0;
  }

  async load(boards) {
    const board = boards.find((b) => b.info?.description);
    const key = board ? `${board.name}#${board.number}` : "";
    if (key === this.key) return;
    this.key = key;
    this.clear();
    this.note.textContent = board ? "Loading the robot …" : "The robot's description is not known yet.";
    if (!board) return;
    const answer = await fetch(`robot/${board.number}.urdf`);
    if (!answer.ok) { this.note.textContent = "The board publishes no robot_description."; return; }
    const text = await answer.text();
    const meshes = new Map();
    const loaded = [];
    const parse = (make) => {
      const loader = new URDFLoader();
      loader.packages = "";
      loader.loadMeshCb = (path, _manager, _material, done) => {
        const waiting = this.mesh(path, meshes)
          .then((mesh) => { done(make(mesh)); return mesh; }, () => done(new THREE.Group()));
        loaded.push(waiting);
      };
      return loader.parse(text);
    };
    let robot;
    let ghost;
    try {
      robot = parse((mesh) => mesh.clone(true));
      ghost = parse((mesh) => mesh.clone(true));
    } catch (error) { this.fail(error); return; }
    await Promise.all(loaded);
    if (key !== this.key) return;
    const pale = new THREE.MeshStandardMaterial({ color: 0x4c9be8, transparent: true, opacity: 0.28,
      depthWrite: false });
    this.paint(robot);
    this.ghostParts = [];
    ghost.traverse((part) => {
      if (!part.isMesh) return;
      part.material = pale;
      part.renderOrder = 1;
      this.ghostParts.push([part, jointsAbove(part)]);
    });
    this.robot = robot;
    this.ghost = ghost;
    this.size = Math.max(new THREE.Box3().setFromObject(robot).getSize(new THREE.Vector3()).length() / 2, 0.2);
    this.scene.add(robot, ghost);
    this.note.textContent = "";
    this.draw(boards, true);
    this.fit();
  }

  clear() {
    for (const robot of [this.robot, this.ghost]) if (robot) this.scene.remove(robot);
    for (const push of this.pushes.values()) push.close();
    this.pushes.clear();
    this.robot = this.ghost = null;
  }

  /** Omit a description that cannot be drawn; the rest of the page works. */
  fail(error) {
    this.clear();
    this.note.textContent = `The robot's description cannot be drawn: ${String(error.message).slice(0, 200)}`;
  }

  /** A material per joint, coloured by its torque. */
  paint(robot) {
    this.colours.clear();
    for (const [name, joint] of Object.entries(robot.joints)) {
      if (joint.jointType === "fixed") continue;
      const material = new THREE.MeshStandardMaterial({ color: 0xc9ced6, roughness: 0.6, metalness: 0.1 });
      this.colours.set(name, material);
    }
    const plain = new THREE.MeshStandardMaterial({ color: 0xaab1bb, roughness: 0.65, metalness: 0.1 });
    robot.traverse((part) => {
      if (!part.isMesh) return;
      let above = part.parent;
      while (above && !(above.isURDFJoint && this.colours.has(above.name))) above = above.parent;
      part.material = above ? this.colours.get(above.name) : plain;
    });
  }

  mesh(path, known) {
    if (!path || path.endsWith("/")) return Promise.reject(new Error("no mesh"));
    if (!known.has(path)) known.set(path, this.read(path.replace(/^.*?(mesh\/\d+\/)/, "$1")));
    return known.get(path);
  }

  async read(path) {
    const ending = path.split(".").pop();
    if (ending === "stl") return new THREE.Mesh(await new STLLoader().loadAsync(path));
    if (ending === "obj") return new OBJLoader().loadAsync(path);
    const collada = await new ColladaLoader().loadAsync(path);
    return collada.scene;
  }

  fit() {
    if (!this.robot) return;
    const box = new THREE.Box3().setFromObject(this.robot);
    this.grid.position.z = Math.min(box.min.z, 0);
    const centre = box.getCenter(new THREE.Vector3());
    const radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 0.2);
    const angle = Math.min(this.camera.fov, this.camera.fov * this.camera.aspect) * Math.PI / 360;
    const direction = new THREE.Vector3(1.2, -1.5, 0.55).normalize();
    this.camera.position.copy(centre).addScaledVector(direction, 1.12 * radius / Math.sin(angle));
    this.controls.target.copy(centre);
    this.controls.update();
    this.placed = true;
    this.drawn = 0;
  }

  /** Fit the view again if a joint has left it, unless turned by hand. */
  keepInside() {
    const now = performance.now();
    if (!this.placed || this.grasp.held || now - this.checked < CHECK) return;
    this.checked = now;
    this.camera.updateMatrixWorld();
    const place = new THREE.Vector3();
    const outside = Object.values(this.robot.links).some((link) => {
      link.getWorldPosition(place).project(this.camera);
      return Math.abs(place.x) > 0.97 || Math.abs(place.y) > 0.97;
    });
    if (outside) this.fit();
  }

  draw(boards, now = false) {
    const time = performance.now();
    if (this.cost === null) this.cost = Math.min(time - this.begun, 500); // to the frame after it
    if (!this.robot || (!now && (time - this.drawn < Math.max(EVERY, SHARE * this.cost - 60) || document.hidden)))
      return;
    this.keepInside();
    const places = boards.flatMap((board) => this.places(board));
    const asked = boards.some((board) => board.joints.some((joint) => joint.proposed !== null));
    const ghost = this.showGhost || asked;
    const look = `${ghost} ${places.map(looks).join()}`;
    if (!now && this.drawn && look === this.look) return; // nothing is seen to move
    this.drawn = this.begun = time;
    this.cost = null;
    this.look = look;
    const apart = new Set();
    for (const { name, joint, position, wanted } of places) {
      this.robot.setJointValue(name, position);
      this.ghost.setJointValue(name, wanted);
      if (Math.abs(position - wanted) > HIDDEN) apart.add(name);
      this.colour(name, joint);
    }
    this.drawPushes(boards);
    this.ghost.visible = ghost && apart.size > 0;
    for (const [part, above] of this.ghostParts) part.visible = above.some((name) => apart.has(name));
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  /** Arrows where joints are pushed from outside. @param {Board[]} boards */
  drawPushes(boards) {
    this.robot.updateMatrixWorld();
    for (const joint of boards.flatMap((board) => board.joints)) {
      if (!Object.hasOwn(this.robot.joints, joint.name)) continue;
      if (!this.pushes.has(joint.name))
        this.pushes.set(joint.name, new Push(this.scene, this.robot.joints[joint.name], 0.17 * this.size));
      this.pushes.get(joint.name).show(joint.externalShare);
    }
  }

  /** Joints of the description moved by a board: measured and wanted position, axis. @param {Board} board */
  places(board) {
    const rows = board.joints.map((joint, k) => [joint.name, [[k, 1]]]);
    const places = [];
    for (const [name, shares] of [...rows, ...board.info?.coupling ?? []]) {
      const axes = shares.map(([k]) => board.joints[k]);
      if (!axes.length || !axes.every((joint) => joint?.state) || !Object.hasOwn(this.robot.joints, name)) continue;
      const sum = (of) => shares.reduce((so, [, share], i) => so + share * of(axes[i]), 0);
      places.push({ name, joint: axes[0], position: sum((joint) => joint.state.position), wanted: sum(wantedOf) });
    }
    return places;
  }

  colour(name, joint) {
    const material = this.colours.get(name);
    if (!material) return;
    if (joint.mode === "hwfa") { material.color.setRGB(0.85, 0.16, 0.16); return; }
    const share = torqueShare(joint);
    material.color.setRGB(0.6 + 0.3 * Math.min(2 * share, 1), 0.63 - 0.42 * share * share - 0.1 * share,
      0.68 - 0.5 * Math.min(2 * share, 1));
  }
}
