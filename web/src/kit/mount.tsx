// Between the frame, whose views are functions of an element, and components.
import { render, type ComponentType } from "preact";
import type { App, View } from "../app";
import type { Route } from "../router";

export interface ViewProps {
  route: Route;
  app: App;
}

/** A view that is a component; it is unmounted when another view takes its place. */
export function view(Component: ComponentType<ViewProps>): View {
  return (root, route, app) => {
    root.replaceChildren();
    render(<Component route={route} app={app} />, root);
    return () => render(null, root);
  };
}
