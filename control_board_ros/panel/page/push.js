// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Torques from outside in the view: an arrow around the axis of each joint that is pushed.

import * as THREE from "three";

const LEAST = 0.03; // share of the torque limit below which there is no arrow
const MOST = 1.6 * Math.PI; // the longest arrow around an axis, at a quarter of the limit
const STEPS = 24; // lengths of arrows that are drawn

const material = new THREE.MeshBasicMaterial({ color: 0xff8a1f, depthTest: false, transparent: true, opacity: 0.9 });
const NEAR_Z = new THREE.Vector3(0, 0, 1);

/** The arrow of a joint of the description, beside the robot: its box is not the robot's. */
export class Push {
  constructor(scene, urdfJoint, radius) {
    this.urdfJoint = urdfJoint;
    this.radius = radius;
    this.length = 0;
    this.group = new THREE.Group();
    this.group.matrixAutoUpdate = false;
    this.group.visible = false;
    this.turn = new THREE.Matrix4()
      .makeRotationFromQuaternion(new THREE.Quaternion().setFromUnitVectors(NEAR_Z, urdfJoint.axis));
    scene.add(this.group);
  }

  show(share) {
    const length = share === null || Math.abs(share) < 4 * LEAST ? 0 : Math.round(STEPS * share) || Math.sign(share);
    if (length !== this.length) this.shape(length);
    if (!length) return;
    this.group.matrix.multiplyMatrices(this.urdfJoint.matrixWorld, this.turn);
    this.group.matrixWorldNeedsUpdate = true;
  }

  shape(length) {
    for (const part of this.group.children) part.geometry.dispose();
    this.group.clear();
    this.length = length;
    this.group.visible = length !== 0;
    if (!length) return;
    const thick = 0.07 * this.radius;
    const head = new THREE.Mesh(new THREE.ConeGeometry(3 * thick, 7 * thick, 12), material);
    const parts = this.urdfJoint.jointType === "prismatic" ? this.straight(length, thick, head)
      : this.round(length, thick, head);
    for (const part of parts) { part.renderOrder = 2; this.group.add(part); }
  }

  /** Around the axis, from the x axis on; right-handed where the torque is positive. */
  round(length, thick, head) {
    const angle = MOST * Math.abs(length) / STEPS;
    const arc = new THREE.Mesh(new THREE.TorusGeometry(this.radius, thick, 8, 40, angle), material);
    const way = Math.sign(length);
    arc.rotation.x = way > 0 ? 0 : Math.PI; // mirrored: it runs the other way round
    head.position.set(this.radius * Math.cos(angle), way * this.radius * Math.sin(angle), 0);
    head.rotation.z = way > 0 ? angle : Math.PI - angle; // a cone points along y
    return [arc, head];
  }

  /** Along the axis of a sliding joint. */
  straight(length, thick, head) {
    const size = 2 * this.radius * length / STEPS;
    const line = new THREE.Mesh(new THREE.CylinderGeometry(thick, thick, Math.abs(size), 8), material);
    line.rotation.x = Math.PI / 2;
    line.position.z = size / 2;
    head.rotation.x = Math.sign(length) * Math.PI / 2;
    head.position.z = size;
    return [line, head];
  }

  close() { this.shape(0); this.group.removeFromParent(); }
}
