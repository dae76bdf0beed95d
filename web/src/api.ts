// Requests to /api/v1, and what it answers.

export type Role = "instructor" | "technician" | "trainee";

export interface Account {
  name: string;
  role: Role;
  trainee?: string;
}

/** A refusal by the server: `code` is for programs, the message for people; `field` names the wrong input. */
export class ApiError extends Error {
  constructor(readonly status: number, readonly code: string, text: string, readonly field: string, readonly retryAfterS: number) {
    super(text);
  }
}

/** No answer at all. */
export class Unreachable extends Error {}

type Query = Record<string, string | number | undefined>;

export class Api {
  /** Called when the server no longer accepts the sign-in. */
  onSignedOut: () => void = () => {};

  get<T>(path: string, query: Query = {}): Promise<T> {
    return this.ask<T>("GET", path + searchOf(query));
  }

  async bytes(path: string, query: Query = {}): Promise<Uint8Array> {
    return new Uint8Array(await (await this.send("GET", path + searchOf(query))).arrayBuffer());
  }

  post<T>(path: string, body: object = {}): Promise<T> {
    return this.ask<T>("POST", path, body);
  }

  patch<T>(path: string, body: object): Promise<T> {
    return this.ask<T>("PATCH", path, body);
  }

  put<T>(path: string, body: object): Promise<T> {
    return this.ask<T>("PUT", path, body);
  }

  delete(path: string): Promise<void> {
    return this.ask<void>("DELETE", path);
  }

  private async ask<T>(method: string, path: string, body?: object): Promise<T> {
    const response = await this.send(method, path, body);
    return (response.status === 204 ? undefined : await response.json().catch(() => undefined)) as T;
  }

  private async send(method: string, path: string, body?: object): Promise<Response> {
    let response: Response;
    try {
      response = await fetch(`/api/v1${path}`, {
        method,
        cache: "no-store",
        headers: body ? { "content-type": "application/json" } : {},
        ...(body ? { body: JSON.stringify(body) } : {}),
      });
    } catch {
      throw new Unreachable();
    }
    if (response.ok) return response;
    const answer: unknown = await response.json().catch(() => undefined);
    const error = (answer as { error?: { code?: string; text?: string; field?: string } } | undefined)?.error;
    if (error?.code === "not_signed_in") this.onSignedOut();
    throw new ApiError(response.status, error?.code ?? "", error?.text ?? "", error?.field ?? "", Number(response.headers.get("retry-after")) || 0);
  }
}

function searchOf(query: Query): string {
  const given = Object.entries(query).filter(([, value]) => value !== undefined && value !== "");
  return given.length ? `?${new URLSearchParams(given.map(([key, value]) => [key, String(value)]))}` : "";
}

/** A part of a path. */
export const part = encodeURIComponent;
