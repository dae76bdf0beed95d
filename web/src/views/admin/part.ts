import type { ComponentType } from "preact";
import type { App } from "../../app";

/** Of the administration: its heading and its list. */
export type Part = ComponentType<{ app: App }>;
