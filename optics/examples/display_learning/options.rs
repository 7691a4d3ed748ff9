//! Options of the example: the displays to simulate and the models to learn.

use lightpath_bench::SimulatedBench;
use lightpath_optics::Orders;
use lightpath_optics::learning::KernelModel;
use std::collections::BTreeMap;

/// Any error of the example.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The program's arguments, each given as `--name value`.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    pub(crate) size_px: (usize, usize),
    /// Propagation distance \[m\]. 0: 0.6 times the critical distance of the shorter side.
    pub(crate) distance_m: f64,
    pub(crate) orders: Orders,
    pub(crate) seeds: Vec<u64>,
    pub(crate) models: Vec<KernelModel>,
    /// Degree of the learned kernels. `None`: the validation pairs choose it.
    pub(crate) degree: Option<usize>,
    pub(crate) pairs: usize,
    pub(crate) validation: usize,
    pub(crate) test: usize,
    pub(crate) targets: usize,
    pub(crate) training_iterations: u32,
    pub(crate) iterations: u32,
    /// Properties of the bench.
    pub(crate) bench: SimulatedBench,
    /// Whether holograms are also optimized through the bench itself, which no learned model can surpass.
    pub(crate) yardstick: bool,
    /// Whether the light is judged instead of its photograph, which the camera's response bends.
    pub(crate) judges_light: bool,
    /// Whether the photographs are judged again after alignment with their targets.
    pub(crate) aligns: bool,
    /// Whether a photograph of a grid of dots tells the camera's map, by which all photographs are corrected.
    pub(crate) calibrates: bool,
    /// Number of training pairs whose photograph belongs to another hologram.
    pub(crate) wrong: usize,
    /// Part of the training photographs' pixels that is overexposed, 0 to 1.
    pub(crate) saturated: f64,
    /// Largest rotation of a training photograph relative to the others.
    pub(crate) rotation_deg: f64,
    /// Largest shift of a training photograph relative to the others.
    pub(crate) jitter_px: f64,
    /// Epochs of Adam. `None`: the default of the model.
    pub(crate) epochs: Option<u32>,
    /// Evaluations of the refinement after Adam. `None`: the default of the model.
    pub(crate) evaluations: Option<u32>,
    pub(crate) threads: usize,
    pub(crate) verbose: bool,
}

impl Options {
    pub(crate) fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Self, Failure> {
        let mut given = BTreeMap::new();
        while let Some(name) = arguments.next() {
            let name = name.strip_prefix("--").ok_or_else(|| format!("{name} is not an option"))?.to_owned();
            let value = arguments.next().ok_or_else(|| format!("--{name} needs a value"))?;
            given.insert(name, value);
        }
        let mut text = |name: &str, default: &str| given.remove(name).unwrap_or_else(|| default.to_owned());
        let models = text("models", "smooth,display");
        let options = Self {
            size_px: size(&text("size", "320x180"))?,
            distance_m: number("distance", &text("distance", "0"))?,
            orders: orders(&text("orders", "first"), number("fill-factor", &text("fill-factor", "1"))?)?,
            seeds: text("seeds", "1").split(',').map(|seed| number("seeds", seed)).collect::<Result<_, _>>()?,
            models: models.split(',').map(model).collect::<Result<_, _>>()?,
            degree: some_number("degree", &text("degree", "auto"))?,
            pairs: number("pairs", &text("pairs", "16"))?,
            validation: number("validation", &text("validation", "2"))?,
            test: number("test", &text("test", "4"))?,
            targets: number("targets", &text("targets", "4"))?,
            training_iterations: number("training-iterations", &text("training-iterations", "60"))?,
            iterations: number("iterations", &text("iterations", "100"))?,
            bench: bench(&text("bench", ""))?,
            yardstick: text("yardstick", "no") == "yes",
            judges_light: text("judge", "photograph") == "light",
            aligns: text("align", "no") == "yes",
            calibrates: text("calibrate", "no") == "yes",
            wrong: number("wrong", &text("wrong", "0"))?,
            saturated: number("saturated", &text("saturated", "0"))?,
            rotation_deg: number("rotation-deg", &text("rotation-deg", "0"))?,
            jitter_px: number("jitter", &text("jitter", "0"))?,
            epochs: some_number("epochs", &text("epochs", "auto"))?,
            evaluations: some_number("evaluations", &text("evaluations", "auto"))?,
            threads: number("threads", &text("threads", "2"))?,
            verbose: text("verbose", "no") == "yes",
        };
        given.keys().next().map_or(Ok(options), |name| Err(format!("--{name} is not an option of this example").into()))
    }
}

/// Diffraction orders of pixels with this fill factor along both axes.
fn orders(name: &str, fill_factor: f64) -> Result<Orders, Failure> {
    match name {
        "first" => Ok(Orders::First),
        "all" => Ok(Orders::All { fill_factor_x: fill_factor, fill_factor_y: fill_factor }),
        other => Err(format!("--orders is {other}, but must be first or all").into()),
    }
}

/// Name of the model in the tables.
pub(crate) fn name(model: KernelModel) -> &'static str {
    match model {
        KernelModel::Paper => "paper",
        KernelModel::Dense => "dense",
        KernelModel::Smooth => "smooth",
        KernelModel::Display => "display",
        KernelModel::Varying => "varying",
    }
}

fn model(name: &str) -> Result<KernelModel, Failure> {
    Ok(match name {
        "paper" => KernelModel::Paper,
        "dense" => KernelModel::Dense,
        "smooth" => KernelModel::Smooth,
        "display" => KernelModel::Display,
        "varying" => KernelModel::Varying,
        other => {
            return Err(format!(
                "--models: {other} is not a model; models are paper, dense, smooth, display and varying"
            )
            .into());
        }
    })
}

/// A bench with some properties given as `name=value,name=value`; the camera is half a pixel off. With `like-the-paper`
/// before them, the others are those of [`SimulatedBench::LIKE_THE_PAPER`].
fn bench(text: &str) -> Result<SimulatedBench, Failure> {
    let (usual, text) = match text.strip_prefix("like-the-paper") {
        Some(text) => (SimulatedBench::LIKE_THE_PAPER, text),
        None => (SimulatedBench { misalignment_px: 0.5, ..SimulatedBench::FAIR }, text),
    };
    let mut properties = serde_json::to_value(usual)?;
    for property in text.split(',').filter(|property| !property.is_empty()) {
        let (name, value) = property.split_once('=').ok_or_else(|| format!("--bench: {property} has no value"))?;
        let value: f64 = number("bench", value)?;
        match properties.get_mut(name) {
            Some(place) if name != "seed" => *place = value.into(),
            _ => return Err(format!("--bench: {name} is not a property of a simulated bench").into()),
        }
    }
    let bench: SimulatedBench = serde_json::from_value(properties)?;
    bench.validate()?;
    Ok(bench)
}

fn size(text: &str) -> Result<(usize, usize), Failure> {
    let (width, height) = text.split_once('x').ok_or("--size must be WIDTHxHEIGHT, such as 320x180")?;
    Ok((number("size", width)?, number("size", height)?))
}

fn number<T: std::str::FromStr>(name: &str, text: &str) -> Result<T, Failure> {
    text.parse().map_err(|_| format!("--{name} is {text}, but must be a number").into())
}

fn some_number<T: std::str::FromStr>(name: &str, text: &str) -> Result<Option<T>, Failure> {
    if text == "auto" { Ok(None) } else { number(name, text).map(Some) }
}
