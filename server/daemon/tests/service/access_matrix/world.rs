//! A display with everything: artifacts, datasets, jobs in every state, kernels, moves and a pause.

use super::person::Person;
use crate::access::{Guarded, create_token};
use crate::interpolation::{bench, hologram_and_photo};
use crate::serving::{sized_display, small_display};
use lightpath_artifacts::digest_of;
use lightpath_domain::access::Role;
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1::{self, job_spec};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Distances of the photographs \[m\], and the names of their datasets.
const DISTANCES: [(f64, &str); 2] = [(4e-3, "near"), (6e-3, "far")];
const PAIRS: u64 = 4;
/// Where webhooks may go. Nobody answers there.
pub(super) const WEBHOOK_ORIGIN: &str = "http://127.0.0.1:1";

/// Names of the things on one display. The examples of requests refer to them by keys such as `$near`.
#[derive(Clone, Debug)]
pub(super) struct World {
    pub(super) prefix: &'static str,
    values: BTreeMap<&'static str, Value>,
}

impl World {
    /// A message or a part of it, with names in place of keys.
    pub(super) fn resolved(&self, template: &Value) -> Value {
        match template {
            Value::String(key) if key.starts_with('$') => self.value(key).clone(),
            Value::Array(items) => items.iter().map(|item| self.resolved(item)).collect(),
            Value::Object(fields) => {
                Value::Object(fields.iter().map(|(name, value)| (name.clone(), self.resolved(value))).collect())
            }
            other => other.clone(),
        }
    }

    pub(super) fn value(&self, key: &str) -> &Value {
        self.values.get(&key[1..]).unwrap_or_else(|| panic!("no world has {key}"))
    }

    pub(super) fn text(&self, key: &str) -> &str {
        self.value(key).as_str().unwrap()
    }

    /// The display of a kernel.
    pub(super) fn display(&self, key: &str) -> &str {
        self.text(key).split_once("/kernels/").unwrap().0
    }

    pub(super) fn set(&mut self, key: &'static str, value: impl Into<Value>) {
        self.values.insert(key, value.into());
    }

    /// A world whose things do not exist. Each name has the length of the one in this world, and the same place in
    /// lists.
    pub(super) fn missing(&self) -> Self {
        let missing = |(key, value): (&&'static str, &Value)| match value {
            Value::String(text) => (*key, Value::from(missing(text, self.prefix))),
            Value::Number(_) => (*key, Value::from(9)),
            other => panic!("{key}: {other}"),
        };
        Self { prefix: "missing", values: self.values.iter().map(missing).collect() }
    }
}

/// A name like `text` of something that does not exist.
pub(super) fn missing(text: &str, prefix: &str) -> String {
    match text {
        "3" => "9".to_owned(),
        digest if digest.starts_with("sha256-") => digest_of(digest.as_bytes()),
        job if job.starts_with("jobs/") => with_last(job),
        other => other.replace(prefix, &with_last(prefix)),
    }
}

/// A text with another last character.
fn with_last(text: &str) -> String {
    let (rest, last) = text.split_at(text.len() - 1);
    format!("{rest}{}", if last == "b" { "c" } else { "b" })
}

/// Builds a world on the displays `prefix` and `prefix-spare`, whose owner may use these only.
pub(super) async fn build(guarded: &Guarded, prefix: &'static str, seed: u64) -> World {
    let spare = format!("{prefix}-spare");
    let admin = Person { serving: &guarded.serving, name: "admin".into(), token: guarded.tokens["admin"].clone() };
    let displays = [
        v1::Display {
            bench: Some(v1::display::Bench::SimulatedBench(v1::SimulatedBench::default())),
            ..small_display(prefix)
        },
        sized_display(&spare, 128, 96),
    ];
    for display in displays {
        let request = v1::CreateDisplayRequest { display: Some(display) };
        admin.ask::<v1::Display>("DisplayService/CreateDisplay", request).await.unwrap();
    }
    let name = format!("{prefix}-owner");
    let scope = [prefix.to_owned(), spare.clone()];
    let token = create_token(&guarded.store().await, &name, Role::Admin, &scope, None).await;
    let builder = Builder { owner: Person { serving: &guarded.serving, name: name.clone(), token }, prefix, seed };
    let mut world = World { prefix, values: BTreeMap::new() };
    world.set("display", format!("displays/{prefix}"));
    world.set("spare", format!("displays/{spare}"));
    world.set("owner", name);
    world.set("version", format!("{}/versions/2", builder.kernel()));
    world.set("kernel", builder.kernel());
    builder.add_webhook(&mut world).await;
    builder.add_datasets(&mut world).await;
    builder.add_kernels(&mut world).await;
    builder.add_rollouts(&mut world).await;
    builder.add_jobs(&mut world).await;
    builder.add_uploads(&mut world).await;
    world
}

/// Makes the things on one display.
struct Builder<'a> {
    owner: Person<'a>,
    prefix: &'static str,
    seed: u64,
}

impl Builder<'_> {
    fn kernel(&self) -> String {
        format!("displays/{}/kernels/515nm-4mm", self.prefix)
    }

    fn request(&self, kind: job_spec::Kind) -> v1::SubmitJobRequest {
        let batch = format!("{}-batch", self.prefix);
        v1::SubmitJobRequest { spec: Some(v1::JobSpec { kind: Some(kind) }), batch, ..Default::default() }
    }

    /// Runs a job to its end.
    async fn run(&self, kind: job_spec::Kind) -> v1::Job {
        let job = self.owner.submit(self.request(kind)).await;
        let job = self.owner.until_ended(&job.name).await;
        assert_eq!(job.state(), v1::job::State::Succeeded, "{job:?}");
        job
    }

    /// Adds a webhook that learns of everything that happens afterwards.
    async fn add_webhook(&self, world: &mut World) {
        let (id, display) = (format!("{}-hook", self.prefix), format!("displays/{}", self.prefix));
        let url = format!("{WEBHOOK_ORIGIN}/{}", self.prefix);
        let request = v1::CreateWebhookRequest { id: id.clone(), url, display, ..Default::default() };
        let created: v1::Webhook = self.owner.ask("WebhookService/CreateWebhook", request).await.unwrap();
        world.set("webhook", created.name.clone());
        world.set("new_webhook", created.name);
        world.set("new_webhook_id", id);
    }

    async fn add_datasets(&self, world: &mut World) {
        let mut last = v1::Pair::default();
        for (distance_m, key) in DISTANCES {
            let name = self.add_dataset(key, distance_m).await;
            for n in 0..PAIRS {
                last = self.pair(distance_m, n).await;
                self.add_pair(&name, &last).await;
            }
            let finalize = v1::prepare_dataset::Finalize { keep_alignment: true, ..Default::default() };
            let step = Some(v1::prepare_dataset::Step::Finalize(finalize));
            self.run(job_spec::Kind::PrepareDataset(v1::PrepareDataset { dataset: name.clone(), step })).await;
            world.set(key, name);
        }
        let open = self.add_dataset("open", DISTANCES[1].0).await;
        self.add_pair(&open, &self.pair(DISTANCES[1].0, 0).await).await;
        world.set("open", open);
        world.set("pair_phase", last.pattern);
        world.set("pair_photo", last.photo);
        world.set("new_dataset", format!("datasets/{}-near", self.prefix));
    }

    async fn add_dataset(&self, key: &str, distance_m: f64) -> String {
        let (name, display) = (format!("datasets/{}-{key}", self.prefix), format!("displays/{}", self.prefix));
        let dataset =
            v1::Dataset { name: name.clone(), display, place: Some(v1::Place::at_m(distance_m)), ..Default::default() };
        let request = v1::CreateDatasetRequest { dataset: Some(dataset) };
        self.owner.ask::<v1::Dataset>("DatasetService/CreateDataset", request).await.unwrap();
        name
    }

    async fn pair(&self, distance_m: f64, n: u64) -> v1::Pair {
        let (levels, photo) = hologram_and_photo(&bench(distance_m), 100 * self.seed + n);
        let phase = self.owner.upload(&pictures::levels_png(&levels, 8).unwrap()).await;
        let photo = self.owner.upload(&pictures::grey_png_linear(&photo).unwrap()).await;
        v1::Pair { id: format!("{}-{n}", self.prefix), pattern: phase, photo, ..Default::default() }
    }

    async fn add_pair(&self, dataset: &str, pair: &v1::Pair) {
        let request = v1::AddPairsRequest { dataset: dataset.to_owned(), pairs: vec![pair.clone()] };
        self.owner.ask::<v1::AddPairsResponse>("DatasetService/AddPairs", request).await.unwrap();
    }

    /// Learns kernels for both distances together, and imports a second version for the near one. A third version
    /// exists on the display `faraway` only.
    async fn add_kernels(&self, world: &mut World) {
        let datasets = vec![world.text("$near").to_owned(), world.text("$far").to_owned()];
        let (epochs, refinement_evaluations) = (Some(1), Some(0));
        let learn = v1::LearnKernel { datasets, degree: Some(4), epochs, refinement_evaluations, ..Default::default() };
        let job = self.run(job_spec::Kind::LearnKernel(learn)).await;
        world.set("ended", job.name);
        let name = format!("{}/versions/1", self.kernel());
        let get = v1::GetKernelVersionRequest { name: name.clone() };
        let learned: v1::KernelVersion = self.owner.ask("KernelService/GetKernelVersion", get).await.unwrap();
        let versions = if self.prefix == "faraway" { 2..=3 } else { 2..=2 };
        for version in versions.clone() {
            let request = v1::ImportKernelRequest {
                display: format!("displays/{}", self.prefix),
                place: Some(v1::Place::at_m(DISTANCES[0].0)),
                artifact: learned.artifact.clone(),
                ..Default::default()
            };
            let imported: v1::KernelVersion = self.owner.ask("KernelService/ImportKernel", request).await.unwrap();
            assert_eq!(imported.version, version);
        }
        for version in [1, *versions.end()] {
            let reason = format!("{} reason", self.prefix);
            let kernel = self.kernel();
            let request = v1::PromoteKernelRequest { kernel, version, reason, force: true, ..Default::default() };
            self.owner.ask::<v1::Kernel>("KernelService/PromoteKernel", request).await.unwrap();
        }
        world.set("file", learned.artifact);
        world.set("learned_version", name);
        world.set("number", *versions.end());
    }

    /// Halts one rollout of the far kernel and starts another one, and puts two devices into a group.
    async fn add_rollouts(&self, world: &mut World) {
        let kernel = format!("displays/{}/kernels/515nm-6mm", self.prefix);
        let start = v1::StartRolloutRequest {
            kernel: kernel.clone(),
            version: 1,
            share: 0.1,
            reason: format!("{} rollout", self.prefix),
            force: true,
            ..Default::default()
        };
        let first: v1::Rollout = self.owner.ask("RolloutService/StartRollout", start.clone()).await.unwrap();
        let halt = v1::HaltRolloutRequest { name: first.name, reason: format!("{} halt", self.prefix) };
        self.owner.ask::<v1::Rollout>("RolloutService/HaltRollout", halt).await.unwrap();
        let second: v1::Rollout = self.owner.ask("RolloutService/StartRollout", start).await.unwrap();
        for n in 1..=2 {
            let name = format!("displays/{0}/devices/{0}-device-{n}", self.prefix);
            let request = v1::SetDeviceGroupRequest { name: name.clone(), group: "first".into() };
            self.owner.ask::<v1::Device>("DeviceService/SetDeviceGroup", request).await.unwrap();
            world.set("device", name);
            world.set("rig", format!("displays/{}/rig", self.prefix));
        }
        world.set("far_kernel", kernel);
        world.set("rollout", second.name);
        world.set("next_rollout", format!("{}/rollouts/1", self.kernel()));
    }

    fn hologram(&self, target: &str) -> v1::SubmitJobRequest {
        let plane = v1::optimize_hologram::ImagePlane {
            place: Some(v1::Place::at_m(4e-3)),
            target: target.to_owned(),
            weight: None,
        };
        self.request(job_spec::Kind::OptimizeHologram(v1::OptimizeHologram {
            display: format!("displays/{}", self.prefix),
            planes: vec![plane],
            kernel: Some(v1::KernelChoice::ideal()),
            iterations: Some(3),
            ..Default::default()
        }))
    }

    /// Runs a hologram job, pauses the display, and leaves other jobs in the queue.
    async fn add_jobs(&self, world: &mut World) {
        let picture = Plane::from_fn(48, 64, |y, x| ((y + x + self.seed as usize) % 97) as f32 / 97.0);
        let target = self.owner.upload(&pictures::grey_png_srgb(&picture).unwrap()).await;
        let ended = self.run(self.hologram(&target).spec.unwrap().kind.unwrap()).await;
        world.set("hologram", ended.name.clone());
        let Some(v1::job_result::Kind::OptimizeHologram(result)) = ended.result.and_then(|result| result.kind) else {
            panic!("{:?}", ended.error)
        };
        let subframe = &result.wavelengths[0].subframes[0];
        world.set("levels", subframe.pattern.clone());
        world.set("phase_npy", subframe.phase.clone());
        let (display, reason) = (format!("displays/{}", self.prefix), format!("{} pause", self.prefix));
        let pause = v1::PauseQueueRequest { display, reason };
        self.owner.ask::<v1::Queue>("JobService/PauseQueue", pause).await.unwrap();
        let labelled = v1::SubmitJobRequest {
            request_id: format!("{}-request", self.prefix),
            unique_key: format!("{}-key", self.prefix),
            ..self.hologram(&target)
        };
        world.set("waiting", self.owner.submit(labelled).await.name);
        for key in ["doomed", "cancelled"] {
            world.set(key, self.owner.submit(self.hologram(&target)).await.name);
        }
        let cancel = v1::CancelJobRequest { name: world.text("$cancelled").to_owned() };
        self.owner.ask::<v1::Job>("JobService/CancelJob", cancel).await.unwrap();
        world.set("target", target);
        world.set("batch", format!("{}-batch", self.prefix));
        world.set("request", format!("{}-request", self.prefix));
        world.set("key", format!("{}-key", self.prefix));
    }

    /// Leaves an upload half done.
    async fn add_uploads(&self, world: &mut World) {
        let bytes = self.prefix.repeat(20).into_bytes();
        let digest = digest_of(&bytes);
        self.owner.upload_part(&digest, bytes.len() as u64, &bytes[..50]).await.unwrap_err();
        world.set("upload", digest);
    }
}

/// Adds jobs on the display of `own` that wait for jobs on the display of `foreign`. One of them has failed because the
/// other was cancelled.
pub(super) async fn add_jobs_that_wait_for(guarded: &Guarded, own: &mut World, foreign: &mut World) {
    let admin = Person { serving: &guarded.serving, name: "admin".into(), token: guarded.tokens["admin"].clone() };
    for (key, other) in [("mixed", "$waiting"), ("failed", "$doomed")] {
        let spec = json!({ "optimize_hologram": {
            "display": own.text("$display"),
            "planes": [{ "place": { "distance_m": 4e-3 }, "target": own.text("$target") }],
            "kernel": { "ideal": {} },
        }});
        let spec = Some(serde_json::from_value(spec).unwrap());
        let after = vec![foreign.text(other).to_owned()];
        let job = admin.submit(v1::SubmitJobRequest { spec, after, ..Default::default() }).await;
        own.set(key, job.name);
        foreign.set(key, foreign.text(other).to_owned());
    }
    let cancel = v1::CancelJobRequest { name: foreign.text("$doomed").to_owned() };
    admin.ask::<v1::Job>("JobService/CancelJob", cancel).await.unwrap();
}
