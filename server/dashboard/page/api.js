// Calls of the API over HTTP. The token stays in memory, so that it is gone with the page.

let token = "";
const signInListeners = new Set();

/** A refusal of the server (RFC 9457) with its reason and fix, or a server that does not answer (status 0). */
export class ApiError extends Error {
  constructor(status, message, { reason = "", fix = "", fields = [] } = {}) {
    super(message);
    this.status = status;
    this.reason = reason;
    this.fix = fix;
    this.fields = fields;
  }
}

export function setToken(text) {
  token = text;
}

export function hasToken() {
  return token !== "";
}

/** Calls `listener` when the server asks for a token. */
export function onSignInNeeded(listener) {
  signInListeners.add(listener);
}

/** The answer of a request. The browser sends the ETag of what it has, so unchanged answers are not sent again. */
export async function request(path, { method = "GET", body, headers = {}, signal } = {}) {
  const fields = { ...headers };
  if (token) fields.authorization = `Bearer ${token}`;
  if (body !== undefined) fields["content-type"] ??= "application/json";
  let response;
  try {
    response = await fetch(path, { method, body, headers: fields, signal, cache: "no-cache", credentials: "omit" });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ApiError(0, "The server does not answer.");
  }
  if (response.ok) return response;
  const problem = await response.json().catch(() => null);
  if (response.status === 401) for (const listener of signInListeners) listener();
  throw new ApiError(response.status, problem?.detail ?? `The server answered ${response.status}.`, problem ?? {});
}

export async function get(path, parameters = {}, options = {}) {
  const query = new URLSearchParams(Object.entries(parameters).filter(([, value]) => value !== "" && value != null));
  const text = query.toString();
  return (await request(`/v1/${path}${text ? `?${text}` : ""}`, options)).json();
}

/** The values of the server's metrics without labels, by their names. */
export async function metrics() {
  const text = await (await request("/metrics")).text();
  return Object.fromEntries([...text.matchAll(/^(\w+) (\S+)$/gm)].map(([, name, value]) => [name, Number(value)]));
}

export async function post(path, message = {}) {
  return (await request(`/v1/${path}`, { method: "POST", body: JSON.stringify(message) })).json();
}

/** A picture as a URL for `img`, which cannot send the token itself. The caller revokes the URL. */
export async function pictureUrl(path, options = {}) {
  const response = await request(path, options);
  return URL.createObjectURL(await response.blob());
}
