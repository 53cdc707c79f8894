// The worker that holds the engine: it answers what engine.js asks, and tells those who follow a session what is new.

import { meshes, text, unpacked } from "./packed.js";

let engine = null;
/** Those who follow, by number: of which session, and the part of its recording and the step that come next. */
const followers = new Map();
/** The last request to each session that takes its time: the next waits for it. */
const busy = new Map();

const { port1: here, port2: there } = new MessageChannel();
/** Lets what has come meanwhile go first. */
const turn = () => new Promise((resolve) => {
  here.onmessage = resolve;
  there.postMessage(null);
});

onmessage = ({ data }) => receive[data.is]?.(data);

const receive = {
  async begin({ script, wasm, bytes, shapes, scenarios, sessions }) {
    try {
      const brought = meshes(shapes);
      const module = await import(script);
      await module.default({ module_or_path: await unpacked(wasm, bytes) });
      module.bring_meshes(await brought);
      engine = new module.Engine();
      for (const { file, source, data } of scenarios) {
        const texts = await Promise.all(Object.values(data).map(text));
        engine.add(file, await text(source), Object.keys(data), texts);
      }
      for (const { id, events } of sessions) engine.take_up(id, await text(events));
      postMessage({});
    } catch (error) {
      postMessage({ failure: String(error.message ?? error) });
    }
  },

  async ask({ number, method, path, body }) {
    const session = /^\/v1\/sessions\/([^/?]+)/.exec(path)?.[1];
    // What ends a session waits for nobody.
    const before = method === "DELETE" ? undefined : busy.get(session);
    const answer = (before ?? Promise.resolve()).then(() => answered(method, path, body, session));
    if (session !== undefined) busy.set(session, answer.catch(() => {}));
    const { status, body: bytes } = await answer;
    postMessage({ number, status, body: bytes.buffer }, [bytes.buffer]);
    if (method === "DELETE") busy.delete(session);
  },

  follow({ follower, session }) {
    followers.set(follower, { session, part: 0, step: 0 });
    tell(session);
  },

  leave({ follower }) {
    followers.delete(follower);
  },
};

async function answered(method, path, body, session) {
  const answer = engine.ask(method, path, new TextEncoder().encode(body));
  if (typeof answer !== "number") {
    if (method === "POST") tell(session);
    return answer;
  }
  for (;;) {
    const done = engine.go_on(answer);
    tell(session);
    if (done !== undefined) return done;
    await turn();
  }
}

/** Tells those who follow a session what they do not have. */
function tell(session) {
  for (const [follower, next] of followers) {
    if (next.session !== session) continue;
    const news = engine.news(session, next.part, next.step);
    if (news === undefined) continue;
    const [parts, messages] = news;
    next.part += parts.length;
    next.step += messages.length;
    const buffers = parts.map((part) => part.buffer);
    if (buffers.length + messages.length > 0) postMessage({ follower, parts: buffers, messages }, buffers);
  }
}
