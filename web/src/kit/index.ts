// What views are put together from. `chart` is apart: only views with charts load uPlot.
export * from "./dialog";
export { Icon, type IconName } from "./icon";
export * from "./keys";
export * from "./listing";
export * from "./live";
export * from "./mount";
export * from "./parts";
