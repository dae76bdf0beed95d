// Addresses of views: #/NAME/ARGUMENT/...?KEY=VALUE.

export interface Route {
  name: string; // "" at #/ and where there is none
  args: string[];
  query: URLSearchParams;
}

export function parseRoute(hash: string): Route {
  const text = hash.replace(/^#?\/?/, "");
  const mark = text.indexOf("?");
  const path = mark < 0 ? text : text.slice(0, mark);
  const [name = "", ...args] = path.split("/").map(unescaped);
  return { name, args: args.filter((part) => part !== ""), query: new URLSearchParams(mark < 0 ? "" : text.slice(mark + 1)) };
}

export function routeTo(name: string, args: string[] = [], query: Record<string, string> = {}): string {
  const given = Object.entries(query).filter(([, value]) => value !== "");
  const search = given.length ? `?${new URLSearchParams(given)}` : "";
  return `#/${[name, ...args].map(encodeURIComponent).join("/")}${search}`;
}

function unescaped(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part; // a % that escapes nothing
  }
}
