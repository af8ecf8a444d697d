// Walking: drag to look around, W A S D to walk, E and Q to rise and sink, Shift to run, the wheel for the pace.

import { Euler, Vector3 } from "three";

const RADIANS_PER_PIXEL = 0.003;
const STEPS = {
  KeyW: [0, 0, -1], KeyS: [0, 0, 1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyE: [0, 1, 0], KeyQ: [0, -1, 0],
  ArrowUp: [0, 0, -1], ArrowDown: [0, 0, 1], ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0],
};

export class Walk {
  /** Metres a second. */
  pace = 2;
  #held = new Set();

  /** `onMove` is called when there is something new to draw. */
  constructor(camera, canvas, onMove) {
    this.camera = camera;
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      this.#turn(event.movementX, event.movementY);
      onMove();
    });
    canvas.addEventListener("wheel", (event) => {
      this.pace *= 2 ** (-Math.sign(event.deltaY) / 4);
    }, { passive: true });
    addEventListener("keydown", (event) => {
      if (!(event.code in STEPS) || event.target.closest?.("select, input[type=range]")) return;
      this.#held.add(event.code);
      onMove();
    });
    addEventListener("keyup", (event) => this.#held.delete(event.code));
    addEventListener("keydown", (event) => (this.running = event.shiftKey));
    addEventListener("keyup", (event) => (this.running = event.shiftKey));
    addEventListener("blur", () => this.#held.clear());
  }

  /** Moves the camera on; true while a key is held. */
  step(seconds) {
    const move = new Vector3();
    for (const code of this.#held) move.add(new Vector3(...STEPS[code]));
    const metres = this.pace * seconds * (this.running ? 4 : 1);
    const rise = move.y;
    move.setY(0).applyQuaternion(this.camera.quaternion);
    move.y += rise;
    this.camera.position.addScaledVector(move, metres);
    return this.#held.size > 0;
  }

  #turn(x, y) {
    const euler = new Euler().setFromQuaternion(this.camera.quaternion, "YXZ");
    euler.y -= x * RADIANS_PER_PIXEL;
    euler.x = Math.max(-1.57, Math.min(1.57, euler.x - y * RADIANS_PER_PIXEL));
    euler.z = 0;
    this.camera.quaternion.setFromEuler(euler);
  }
}
