// What the socket said, as signals. Many messages between two frames are one change.
import { useSignal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useLayoutEffect } from "preact/hooks";
import type { Feed, StationState, WatchInit } from "../live";

/**
 * Watches as long as the component is there. `key` names what: another one is watched anew. What a passive effect cleans
 * up it cleans up after the next picture: the next view would have begun to watch.
 */
export function useWatch(feed: Feed, key: string, what: () => WatchInit): void {
  useLayoutEffect(() => {
    feed.watch(what());
    return () => feed.unwatch();
  }, [feed, key]);
}

/** What is known of all stations, by their places; a new list at most once a frame. */
export function useStations(feed: Feed): ReadonlySignal<readonly StationState[]> {
  const stations = useSignal<readonly StationState[]>([]);
  useEffect(() => {
    let pending = 0;
    const take = (): void => {
      pending = 0;
      stations.value = [...feed.stations.values()].map((station) => ({ ...station })).sort((a, b) => a.number - b.number);
    };
    const soon = (): void => {
      pending ||= requestAnimationFrame(take);
    };
    take();
    const ends = [feed.on("place", soon), feed.on("moment", soon), feed.onLink(soon)];
    return () => {
      cancelAnimationFrame(pending);
      for (const end of ends) end();
    };
  }, [feed]);
  return stations;
}

/** Now and each second, as long as the component is there. */
export function useEverySecond(what: () => void): void {
  useEffect(() => {
    what();
    const timer = setInterval(what, 1000);
    return () => clearInterval(timer);
  }, []);
}
