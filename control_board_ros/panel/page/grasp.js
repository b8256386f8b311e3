// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Dragging a joint in the 3D view sets its target, with the limits and questions of its slider.

import * as THREE from "three";
import { PositionSlider } from "./sliders.js";

const EDGE = 0.25; // |cos| between line of sight and axis below which the axis is seen from the side
const NEAR = 0.02; // share of the distance to the eye: a point as near to the axis counts as on it
const TURN = 0.01; // rad for each px then
const LOOK = 80; // ms between looks at what is under the pointer

/** The nearest joint that moves a part; not a fixed one. */
function jointOf(part) {
  for (let above = part; above; above = above.parent)
    if (above.isURDFJoint && above.jointType !== "fixed") return above;
  return null;
}

export class Grasp {
  /** A joint is dragged where its card has a slider for positions that is alive. @param {View} view */
  constructor(view) {
    this.view = view;
    this.on = false;
    this.held = this.over = null;
    this.looked = 0;
    this.ray = new THREE.Raycaster();
    const { canvas } = view;
    const listen = (name, listener) => view.element.addEventListener(name, listener, { capture: true });
    listen("pointerdown", (event) => { if (event.target === canvas) this.take(event); });
    listen("pointermove", (event) => {
      if (this.held) this.drag(event);
      else if (event.target === canvas) this.look(event);
    });
    listen("pointerup", (event) => { if (this.held) this.release(event); });
    for (const name of ["pointercancel", "lostpointercapture"]) listen(name, () => this.drop());
  }

  turn(on) {
    this.on = on;
    this.drop();
    this.mark(null);
  }

  aim(event) {
    const box = this.view.canvas.getBoundingClientRect();
    this.ray.setFromCamera(new THREE.Vector2(2 * (event.clientX - box.left) / box.width - 1,
      1 - 2 * (event.clientY - box.top) / box.height), this.view.camera);
    return this.ray.ray;
  }

  /** Joint, slider and point under the pointer; null where nothing can be dragged. */
  find(event) {
    const { view } = this;
    if (!this.on || !view.robot) return null;
    this.aim(event);
    const [hit] = this.ray.intersectObject(view.robot, true);
    const joint = hit && jointOf(hit.object);
    const card = joint && view.panel.cards.find((one) => one.joint.name === joint.name);
    const slider = card?.sliders.find((one) => one instanceof PositionSlider);
    return slider && !slider.input.disabled ? { joint, slider, point: hit.point } : null;
  }

  look(event) {
    if (!this.on || event.buttons || performance.now() - this.looked < LOOK) return;
    this.looked = performance.now();
    this.mark(this.find(event));
  }

  /** Highlight the joint under the pointer. */
  mark(found) {
    const name = found?.joint.name ?? null;
    if (name === this.over) return;
    const { colours } = this.view;
    colours.get(this.over)?.emissive.setHex(0);
    colours.get(name)?.emissive.setHex(0x1d4f80);
    this.over = name;
    this.view.canvas.style.cursor = name ? "grab" : "";
    this.view.drawn = 0;
  }

  take(event) {
    const found = event.button === 0 ? this.find(event) : null;
    if (!found) return;
    event.stopPropagation(); // the view does not turn
    this.mark(found);
    const { joint, slider, point } = found;
    const origin = joint.getWorldPosition(new THREE.Vector3());
    const axis = joint.axis.clone().transformDirection(joint.matrixWorld).normalize();
    slider.begin(false);
    this.held = { ...found, origin, axis, start: slider.joint.state.position, x: event.clientX, y: event.clientY,
      point };
    this.view.canvas.setPointerCapture(event.pointerId);
  }

  drag(event) {
    event.stopPropagation();
    const { slider, start } = this.held;
    const { lower, upper } = slider.joint;
    slider.input.value = String(Math.min(Math.max(start + this.way(event), lower), upper));
    slider.moved();
    this.view.drawn = 0;
  }

  /** Displacement of the joint by the pointer, rad or m. */
  way(event) {
    const { joint, origin, axis, point } = this.held;
    if (joint.jointType === "prismatic") return this.along(event);
    const ray = this.aim(event);
    if (Math.abs(ray.direction.dot(axis)) < EDGE) return this.bySide(event);
    const there = ray.intersectPlane(new THREE.Plane().setFromNormalAndCoplanarPoint(axis, point), new THREE.Vector3());
    if (!there) return 0;
    const centre = origin.clone().addScaledVector(axis, point.clone().sub(origin).dot(axis));
    const from = point.clone().sub(centre);
    if (from.length() < NEAR * this.view.camera.position.distanceTo(point)) return this.bySide(event);
    const to = there.sub(centre);
    return Math.atan2(from.clone().cross(to).dot(axis), from.dot(to));
  }

  /** An axis seen from the side, or grasped itself: motion across it on the screen turns it. */
  bySide(event) {
    const { camera } = this.view;
    const across = this.held.axis.clone().cross(camera.getWorldDirection(new THREE.Vector3())).normalize();
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
    const up = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1);
    return -TURN * (across.dot(right) * (event.clientX - this.held.x) - across.dot(up) * (event.clientY - this.held.y));
  }

  /** A sliding joint: the nearest point of its axis to the line of sight. */
  along(event) {
    const { point, axis } = this.held;
    const ray = this.aim(event);
    const cross = axis.dot(ray.direction);
    const between = ray.origin.clone().sub(point);
    const apart = 1 - cross * cross;
    return apart < 1e-3 ? 0 : (axis.dot(between) - cross * ray.direction.dot(between)) / apart;
  }

  /** Released: as a tap on the track of the slider. */
  release(event) {
    event.stopPropagation();
    const { slider } = this.held;
    this.held = null;
    if (slider.dragging) slider.released();
  }

  /** Cancelled: nothing is sent. */
  drop() {
    const { held } = this;
    this.held = null;
    held?.slider.drop();
  }
}
