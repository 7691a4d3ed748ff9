//! Finding a judgement in a list.

use crate::v1::judgement::{Model, Orders, Stage};
use crate::v1::{Detector, Judgement};

/// The judgement of the whole region by the engine, on the display's own orders; `None`: it was not measured.
#[must_use]
pub fn judgement(list: &[Judgement], stage: Stage, detector: Detector) -> Option<&Judgement> {
    let is_wanted = |judged: &&Judgement| {
        let own = judged.orders() == Orders::Own && judged.model() == Model::Engine && judged.rows.is_none();
        own && judged.stage() == stage && judged.detector() == detector
    };
    list.iter().find(is_wanted)
}

/// The judgement of the levels on a display that shows other orders; `None`: it was not measured.
#[must_use]
pub fn other_orders(list: &[Judgement]) -> Option<&Judgement> {
    list.iter().find(|judged| judged.orders() == Orders::Other)
}

/// What the engine and the independent model found on the same rows, for each detector for which both judged.
pub fn opinions(list: &[Judgement]) -> impl Iterator<Item = (&Judgement, &Judgement)> {
    let by = |model| move |judged: &&Judgement| judged.model() == model;
    let partner = move |independent: &Judgement| {
        let is_same = |judged: &&Judgement| judged.rows == independent.rows && judged.detector == independent.detector;
        list.iter().filter(by(Model::Engine)).find(is_same)
    };
    list.iter().filter(by(Model::Independent)).filter_map(move |independent| Some((partner(independent)?, independent)))
}

impl Judgement {
    /// The PSNR \[dB\]; NaN if it is missing.
    #[must_use]
    pub fn psnr(&self) -> f64 {
        self.psnr_db.as_ref().map_or(f64::NAN, |measure| measure.value)
    }
}
