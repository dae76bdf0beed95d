// What every view is given.
import type { Account, Api } from "./api";
import type { Feed } from "./live";
import type { Route } from "./router";

export interface App {
  readonly api: Api;
  readonly feed: Feed;
  account: Account | undefined; // undefined: nobody is signed in
  signedIn(account: Account): void;
  /** `everywhere`: all browsers and programs of the account. */
  signOut(everywhere?: boolean): Promise<void>;
  /** Sets the page's title and announces it to screen readers. */
  title(text: string): void;
}

/** Draws itself into the empty `root`; what it returns is called when another view takes its place. */
export type View = (root: HTMLElement, route: Route, app: App) => () => void;
