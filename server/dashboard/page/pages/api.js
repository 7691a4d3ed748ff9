// The API over HTTP, as the server describes it: every call with its parameters, its body and its answer.

import { request } from "../api.js";
import { h, show } from "../dom.js";
import { errorNote } from "../loading.js";
import { table } from "../table.js";

const TITLES = ["Name", "Meaning"];

export function apiPage(root) {
  const text = h("input", { id: "calls", type: "search", placeholder: "jobs, promote, …", oninput: () => list() });
  const body = h("div", {});
  show(root, h("h1", {}, "The API over HTTP"),
    h("p", {}, "Programs can make every call that this dashboard makes. Tools read ", h("a", { href: "/openapi.json", download: "lightpath.json" }, "the OpenAPI document"), ", from which this page is made."),
    h("div", { class: "filters" }, h("label", { for: "calls" }, "Calls that contain", text)), body);
  let calls = [];
  let schemas = {};
  let shared = {};

  function list() {
    const wanted = text.value.trim().toLowerCase();
    const shown = calls.filter(({ search }) => search.includes(wanted));
    const tags = [...new Set(shown.map(({ tag }) => tag))];
    show(body, shown.length === 0 && h("p", {}, "No call contains this text."), tags.map((tag) => h("section", {}, h("h2", {}, tag.replace(/Service$/, "")),
      shown.filter((call) => call.tag === tag).map(callDetails))));
  }

  /** A call, whose tables are made when it is opened. */
  function callDetails({ verb, path, call }) {
    const content = h("div", { class: "call" });
    const fill = () => content.hasChildNodes() || show(content, callContent(verb, path, call));
    return h("details", { ontoggle: fill }, h("summary", {}, h("code", {}, `${verb.toUpperCase()} ${path}`), h("small", {}, call.summary ?? "")), content);
  }

  function callContent(verb, path, { description, parameters = [], requestBody, responses }) {
    const rows = parameters.map((parameter) => (parameter.$ref ? shared[nameOf(parameter)] : parameter)).map(({ name, in: place, description, schema }) => fieldRow(name, `${place}: ${typeOf(schema)}`, schema, description));
    return [
      description && h("p", {}, marked(description)),
      rows.length > 0 && table("Parameters", TITLES, rows),
      fieldTable("Body", schemaOf(requestBody?.content)),
      fieldTable("Answer", schemaOf(responses["200"]?.content)),
      h("pre", { tabindex: 0 }, h("code", {}, curl(verb, path, requestBody))),
    ];
  }

  function schemaOf(content) {
    const schema = Object.values(content ?? {})[0]?.schema;
    return schema?.$ref ? schemas[nameOf(schema)] : schema;
  }

  function fieldTable(title, schema) {
    const fields = Object.entries(schema?.properties ?? {});
    return fields.length > 0 && table(title, TITLES, fields.map(([name, field]) => fieldRow(name, typeOf(field), field, field.description)));
  }

  function fieldRow(name, type, schema, meaning = "") {
    const { enum: known, examples } = (schema.$ref && schemas[nameOf(schema)]) || schema;
    const values = known ?? examples;
    return h("tr", {}, h("th", { scope: "row" }, h("code", {}, name), h("small", {}, type)), h("td", { class: "wide" }, marked(meaning), values && ` One of ${values.join(", ")}.`));
  }

  request("/openapi.json").then((answer) => answer.json()).then((document) => {
    schemas = document.components.schemas;
    shared = document.components.parameters;
    calls = Object.entries(document.paths).flatMap(([path, verbs]) => Object.entries(verbs).map(([verb, call]) =>
      ({ verb, path, call, tag: call.tags?.[0] ?? "Other", search: `${verb} ${path} ${call.summary ?? ""} ${call.operationId ?? ""}`.toLowerCase() })));
    list();
  }).catch((error) => show(body, errorNote(error)));
}

/** A text whose parts between backticks are code. */
function marked(text) {
  return text.split("`").map((part, i) => (i % 2 ? h("code", {}, part) : part));
}

const nameOf = ({ $ref }) => $ref.split("/").pop();

function typeOf(schema) {
  if (schema.$ref) return nameOf(schema);
  if (schema.type === "array") return `list of ${typeOf(schema.items)}`;
  return [schema.type ?? "any", schema.format].filter(Boolean).join(", ");
}

function curl(verb, path, requestBody) {
  const method = verb === "get" ? "" : ` --request ${verb.toUpperCase()}`;
  const isJson = Object.keys(requestBody?.content ?? {}).includes("application/json");
  return `curl '${location.origin}${path}'${method}${isJson ? " --header 'content-type: application/json' --data '{…}'" : ""}`;
}
