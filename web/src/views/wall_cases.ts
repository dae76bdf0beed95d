// The cases that the wall draws, by name and hash: a case that was changed is loaded again. No DOM.

const RETRY_MS = 20_000; // after a case or the list could not be loaded

export interface CaseSource<T> {
  list(): Promise<{ name: string; hash: string | null }[]>; // what the server has now
  load(name: string): Promise<T>;
  later(ms: number, then: () => void): void;
  changed(): void; // there is something new to draw
}

export interface Loaded<T> {
  hash: string;
  value: T;
}

export class CaseCache<T> {
  private readonly loaded = new Map<string, Loaded<T>>();
  private readonly wanted = new Map<string, string>(); // hash of what is loaded or on its way
  private hashes = new Map<string, string>();
  private current = false; // `hashes` are those of the server as it is
  private listing = false;

  constructor(private readonly source: CaseSource<T>) {}

  /** The server may have been restarted: its cases may be others. */
  renew(): void {
    this.current = false;
  }

  /** A case as it was last loaded; undefined: it is not here yet. Loads it where it is missing or was changed. */
  get(name: string): Loaded<T> | undefined {
    if (!this.current) this.list();
    const hash = this.hashes.get(name);
    if (hash !== undefined && this.wanted.get(name) !== hash) void this.load(name, hash);
    return this.loaded.get(name);
  }

  private list(): void {
    if (this.listing) return;
    this.listing = true;
    this.current = true;
    this.source.list().then((cases) => {
      this.listing = false;
      this.hashes = new Map(cases.map(({ name, hash }) => [name, hash ?? ""]));
      this.source.changed();
    }, () => this.source.later(RETRY_MS, () => {
      this.listing = false;
      this.current = false;
      this.source.changed();
    }));
  }

  // What was there is drawn until the new one has come.
  private async load(name: string, hash: string): Promise<void> {
    this.wanted.set(name, hash);
    try {
      const value = await this.source.load(name);
      if (this.wanted.get(name) === hash) this.loaded.set(name, { hash, value });
      this.source.changed();
    } catch {
      this.source.later(RETRY_MS, () => {
        if (this.wanted.get(name) === hash) this.wanted.delete(name);
        this.source.changed();
      });
    }
  }
}
