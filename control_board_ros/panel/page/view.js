// SPDX-License-Identifier: Apache-2.0
// The robot in motion: as measured, its reference as a ghost, torque as colour.

import * as THREE from "three";
import { ColladaLoader } from "three/examples/jsm/loaders/ColladaLoader.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { h, icon } from "./dom.js";
import { OrbitControls } from "./vendor/OrbitControls.js";
import URDFLoader from "./vendor/URDFLoader.js";

const HIDDEN = 0.015; // rad or m: a ghost nearer than this to the robot is not drawn
const FOLLOWING = ["pos", "posd", "mix", "vel"]; // modes with a position reference
const EVERY = 30; // ms between drawings, at least
const SHARE = 4; // a machine that draws slowly spends one part of so many on it

/** The joints that move a part. */
function jointsAbove(part) {
  const names = [];
  for (let above = part.parent; above; above = above.parent) if (above.isURDFJoint) names.push(above.name);
  return names;
}

export class View {
  constructor(element, panel) {
    Object.assign(this, { element, panel, key: "", robot: null, ghost: null, drawn: 0, colours: new Map(), cost: 0 });
    this.canvas = h("canvas", { "aria-label": "The robot in 3D: drag to turn it", tabindex: "0" });
    this.note = h("p", { class: "hint" });
    this.showGhost = true;
    this.ghostButton = h("button", { type: "button", class: "ghost", "aria-pressed": "true", "aria-label": "Show the reference as a ghost", title: "Reference as a ghost", onclick: () => this.toggleGhost() }, icon("ghost"));
    this.fitButton = h("button", { type: "button", class: "ghost", "aria-label": "Show the whole robot", title: "Whole robot", onclick: () => this.fit() }, icon("fit"));
    element.replaceChildren(this.canvas, h("div", { class: "view-tools" }, this.ghostButton, this.fitButton),
      h("div", { class: "scale", "aria-label": "Colour: share of the torque limit" }, "torque", h("span", { class: "ramp" }), "limit"), this.note);
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => { this.drawn = 0; });
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

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.drawn = 0;
  }

  async load(boards) {
    const board = boards.find((b) => b.info?.description);
    const key = board ? `${board.name}#${board.number}` : "";
    if (key === this.key) return;
    this.key = key;
    for (const robot of [this.robot, this.ghost]) if (robot) this.scene.remove(robot);
    this.robot = this.ghost = null;
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
        const waiting = this.mesh(path, meshes).then((mesh) => { done(make(mesh)); return mesh; }, () => done(new THREE.Group()));
        loaded.push(waiting);
      };
      return loader.parse(text);
    };
    const robot = parse((mesh) => mesh.clone(true));
    const ghost = parse((mesh) => mesh.clone(true));
    await Promise.all(loaded);
    if (key !== this.key) return;
    const pale = new THREE.MeshStandardMaterial({ color: 0x4c9be8, transparent: true, opacity: 0.28, depthWrite: false });
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
    this.scene.add(robot, ghost);
    this.note.textContent = "";
    this.draw(boards, true);
    this.fit();
  }

  /** A material for each link of a joint, which its torque colours. */
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
  }

  draw(boards, now = false) {
    const time = performance.now();
    if (this.cost === null) this.cost = Math.min(time - this.drawn, 500); // to the frame after it
    if (!this.robot || (!now && (time - this.drawn < Math.max(EVERY, SHARE * this.cost - 60) || document.hidden))) return;
    this.drawn = time;
    this.cost = null;
    const apart = new Set();
    for (const board of boards) {
      for (const joint of board.joints) {
        const { state } = joint;
        if (!state || !this.robot.joints[joint.name]) continue;
        this.robot.setJointValue(joint.name, state.position);
        const wanted = FOLLOWING.includes(joint.mode) ? state.position_reference : state.position;
        this.ghost.setJointValue(joint.name, wanted);
        if (Math.abs(state.position - wanted) > HIDDEN) apart.add(joint.name);
        this.colour(joint);
      }
    }
    this.ghost.visible = this.showGhost && apart.size > 0;
    for (const [part, above] of this.ghostParts) part.visible = above.some((name) => apart.has(name));
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  colour(joint) {
    const material = this.colours.get(joint.name);
    if (!material) return;
    if (joint.mode === "hwfa") { material.color.setRGB(0.85, 0.16, 0.16); return; }
    const share = Math.min(Math.abs(joint.state.torque || 0) / (joint.limits.torque || 100), 1);
    material.color.setRGB(0.6 + 0.3 * Math.min(2 * share, 1), 0.63 - 0.42 * share * share - 0.1 * share, 0.68 - 0.5 * Math.min(2 * share, 1));
  }
}
