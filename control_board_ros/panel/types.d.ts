// SPDX-License-Identifier: Apache-2.0
// What the page's modules say to each other and to the server; read by tsconfig.json alone.

type Board = import("./page/model.js").Board;
type Card = import("./page/card.js").Card;
type Connection = import("./page/connection.js").Connection;
type Joint = import("./page/model.js").Joint;
type Panel = import("./page/main.js").Panel;
type View = import("./page/view.js").View;

// A vendor's library without types.
declare module "three";
declare module "three/examples/jsm/*";

interface Window { panel: Panel; uPlot: any }

/** An answer of the server; the other fields are the request's own. */
interface Answer { ok: boolean; message?: string; [field: string]: any }
type Asked = Promise<Answer> & { id: number };

/** Of one joint, rad or m, N·m or N; none without a limit. */
interface Limits {
  lower?: number; upper?: number; velocity?: number; acceleration?: number; torque?: number; output?: number;
  peak_current?: number;
}

/** The fault of a joint; its stamp in s. */
interface Fault { name: string; code: number; text: string; stamp: number }

/** The columns of a freeze frame, by signal; null where a sensor is absent. */
type Columns = { time: number[]; [signal: string]: (number | null)[] };

interface Recordings { running: string; busy: string; reports: string[]; folder?: string; since?: number }

/** A signal in the plots. */
interface Plotted {
  joint: Joint; board: string; signal: string; colour: string; beside: string | null;
  times: number[]; values: (number | null)[]; references: (number | null)[];
}

/** A slider of either kind, as a card has it. */
interface Control {
  element: HTMLElement; steps?: HTMLElement; timer?: number;
  layout(): void; draw(): void; drop(): void; close?(): void;
}

/** A number that the details of a joint show and set; null where a text is no number. */
interface Field {
  name: string; title: string;
  unit(): string; show(value: number | null): string; parse(text: string): number | null;
}

/** A board's state, a column for each signal. */
interface BoardState { stamp: number; names: string[]; [signal: string]: any }
