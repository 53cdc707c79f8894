//! The engine in a worker of the visitor's browser.
//!
//! `assets/page/engine.js` speaks with it: the same requests as to a server, answered by [`body_schema_backend::Local`].

#[cfg(target_arch = "wasm32")]
mod engine {
    use body_schema_backend::{Answer, Asked, Job, Local, Progress, Workbench, Worked};
    use js_sys::{Array, Reflect, Uint8Array};
    use wasm_bindgen::prelude::*;

    #[wasm_bindgen]
    extern "C" {
        // Pages that came without encryption have `randomUUID` not.
        #[wasm_bindgen(js_namespace = crypto, js_name = getRandomValues)]
        fn fill_at_random(bytes: &mut [u8]);
    }

    /// A random UUID, of version 4.
    fn random_uuid() -> String {
        let mut bytes = [0; 16];
        fill_at_random(&mut bytes);
        bytes[6] = bytes[6] & 0x0f | 0x40;
        bytes[8] = bytes[8] & 0x3f | 0x80;
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-")
    }

    /// Takes the meshes of robots that ship, in one pack, before there is a session.
    #[wasm_bindgen]
    pub fn bring_meshes(pack: &[u8]) {
        body_schema_recording::bring_meshes(pack);
    }

    /// The sessions of a page.
    #[wasm_bindgen]
    pub struct Engine {
        local: Local,
        /// Steps that are being made, and by which number they are known.
        jobs: Vec<(u32, Job)>,
        begun: u32,
    }

    #[wasm_bindgen]
    impl Engine {
        /// None yet.
        #[wasm_bindgen(constructor)]
        #[expect(clippy::new_without_default, reason = "JavaScript knows no defaults")]
        pub fn new() -> Self {
            Self { local: Local::new(random_uuid), jobs: Vec::new(), begun: 0 }
        }

        /// Adds a scenario from the text of its file, and of those that it names.
        ///
        /// # Errors
        ///
        /// Why it is not valid, as a string.
        pub fn add(&mut self, file: &str, source: &str, names: Vec<String>, texts: Vec<String>) -> Result<(), JsValue> {
            let data: Vec<_> = names.into_iter().zip(texts).collect();
            self.local.add(file, source, &data).map_err(|problem| problem.detail.as_ref().into())
        }

        /// Takes up a session with a robot elsewhere as it was written down.
        ///
        /// # Errors
        ///
        /// Why it is no session, as a string.
        pub fn take_up(&mut self, id: &str, written: &str) -> Result<(), JsValue> {
            self.local.take_up(id, written).map_err(|problem| problem.detail.as_ref().into())
        }

        /// Answers a request: `{status, body}`, or the number of the steps that were begun and are to be [made](Self::go_on).
        pub fn ask(&mut self, method: &str, path: &str, body: &[u8]) -> JsValue {
            match self.local.ask(method, path, body) {
                Asked::Done(answer) => told(answer),
                Asked::Begun(job) => {
                    self.begun += 1;
                    self.jobs.push((self.begun, job));
                    self.begun.into()
                }
            }
        }

        /// Makes more of these steps: `{status, body}` once all are made or one could not be.
        pub fn go_on(&mut self, number: u32) -> Option<JsValue> {
            let index = self.jobs.iter().position(|(known, _)| *known == number)?;
            let answer = self.local.go_on(&mut self.jobs[index].1)?;
            self.jobs.swap_remove(index);
            Some(told(answer))
        }

        /// Makes no more of these steps.
        pub fn give_up(&mut self, number: u32) {
            self.jobs.retain(|(known, _)| *known != number);
        }

        /// What is new of a session: `[parts of the recording from one on, messages from a step on]`; nothing where there is no such
        /// session.
        pub fn news(&self, session: &str, from: usize, step: usize) -> Option<Array> {
            let (parts, messages) = self.local.news(session, from, step)?;
            let parts: Array = parts.iter().map(|part| Uint8Array::from(&part[..])).collect();
            let messages: Array = messages.iter().map(|message| JsValue::from(message.as_str())).collect();
            Some(Array::of2(&parts, &messages))
        }
    }

    /// Where a calibration has got, told to the worker's script as it goes on.
    struct Script;

    #[wasm_bindgen]
    extern "C" {
        #[wasm_bindgen(js_namespace = globalThis, js_name = stage)]
        fn begin_stage(what: &str, steps: f64);
        #[wasm_bindgen(js_namespace = globalThis)]
        fn tick();
    }

    impl Progress for Script {
        fn stage(&self, what: &str, steps: u64) {
            begin_stage(what, steps as f64);
        }

        fn tick(&self) {
            tick();
        }
    }

    /// What is asked about robots of the visitor's own.
    #[wasm_bindgen]
    #[derive(Default)]
    pub struct Bench(Workbench);

    #[wasm_bindgen]
    impl Bench {
        /// Nothing asked yet.
        #[wasm_bindgen(constructor)]
        pub fn new() -> Self {
            Self::default()
        }

        /// Answers a request: `{status, body, recording}`; with the contents of meshes behind their paths. The worker's script has functions
        /// `stage` and `tick`, which are told how far it is.
        pub fn work(&mut self, request: &[u8], paths: Vec<String>, meshes: Vec<Uint8Array>) -> JsValue {
            let meshes = paths.into_iter().zip(meshes.iter().map(Uint8Array::to_vec)).collect();
            let Worked { answer, recording } = self.0.work(request, &meshes, &Script);
            let answer = told(answer);
            let recording = recording.map(|bytes| Uint8Array::from(&bytes[..]));
            let _ = Reflect::set(&answer, &"recording".into(), &recording.into());
            answer
        }
    }

    fn told(Answer { status, body }: Answer) -> JsValue {
        let answer = js_sys::Object::new();
        // An object takes whatever it is given.
        let _ = Reflect::set(&answer, &"status".into(), &status.into());
        let _ = Reflect::set(&answer, &"body".into(), &Uint8Array::from(&body[..]));
        answer.into()
    }
}
