//! Each edge of the course, and the laws that hold on every way through it.

use super::*;
use Block::{Crosstalk, FineSource, Ghost, LightBlur, PartialCoherence, UnevenResponse, Varying};
use TrialStage::{BehindDust, FinalPruning, First, Last, Pruning};
use proptest::prelude::*;

const NONE: Blocks = Blocks::NONE;

fn rules() -> Rules {
    Rules { orders: vec![5, 8, 12], chooses_order: true, blocks: Block::ALL.to_vec(), evaluations: 40 }
}

fn model(number: usize, blocks: Blocks, loss: f64) -> Model {
    Model { number, order: 5, blocks, loss }
}

/// A course in a phase, with a best model of loss 1 that has some blocks.
fn course(phase: Phase, blocks: Blocks) -> Course {
    Course { phase, best: Some(model(1, blocks, 1.0)), ..Course::default() }
}

fn trial(stage: TrialStage, block: Block, untried: &[Block], blocks: Blocks) -> Course {
    let before = model(1, blocks, 1.0);
    let round = Round { stage, before, block, untried: untried.to_vec(), found: None, winner: None };
    course(Phase::Trial(round), blocks)
}

fn order(index: usize, loss_before: f64) -> Phase {
    Phase::Order { index, loss_before: (index > 0).then_some(loss_before) }
}

/// A step that gains, as long as nothing else is said.
const GAINS: Refined = Refined {
    before: Some(1.0),
    loss: 0.5,
    improved: true,
    trusted: true,
    evaluations: 3,
    has_blocks: false,
    validated: None,
};
/// A step that finds no better point.
const FAILS: Refined = Refined { loss: 1.0, improved: false, ..GAINS };

fn refined(step: Refined) -> Verdict {
    Verdict::Refined(step)
}

/// The last step of a trial, after which the model has this validation loss.
fn tried(blocks: Blocks, loss: f64) -> Verdict {
    refined(Refined { validated: Some(model(2, blocks, loss)), ..FAILS })
}

fn dusted(goes_on: bool, evaluations: u32, losses: (f64, f64)) -> Verdict {
    Verdict::Dusted(Dusted { evaluations, goes_on, losses: Some(losses) })
}

/// What a phase is about, in short.
fn told(course: &Course) -> String {
    match &course.phase {
        Phase::Order { index, .. } => format!("order {index}"),
        Phase::Trial(round) => format!("{:?} {:?} {:?}", round.stage, round.block, round.untried),
        Phase::Adoption(stage) => format!("adoption {stage:?}"),
        phase => format!("{phase:?}"),
    }
}

/// A course, a verdict, and the phase that follows.
type Edge = (Course, Verdict, &'static str);

fn check<const N: usize>(edges: [Edge; N]) {
    for (course, verdict, expected) in edges {
        let case = format!("{} and {verdict:?}", told(&course));
        assert_eq!(told(&course.next(&rules(), verdict)), expected, "{case}");
    }
}

fn no_best(course: Course) -> Course {
    Course { best: None, ..course }
}

#[test]
fn orders_and_first_trials_follow_adam() {
    let fine = NONE.with(FineSource);
    check([
        (course(Phase::Adam, NONE), Verdict::Adam { is_last: false }, "Adam"),
        (course(Phase::Adam, NONE), Verdict::Adam { is_last: true }, "Screening"),
        (course(Phase::Screening, NONE), Verdict::Screened { others: true }, "order 0"),
        // An order ends where no step gains. Its first step only evaluates.
        (course(order(0, 0.0), NONE), refined(GAINS), "order 0"),
        (course(order(0, 0.0), NONE), refined(Refined { before: None, loss: 1.0, ..GAINS }), "order 0"),
        (course(order(1, 2.0), NONE), refined(Refined { loss: 0.995, ..GAINS }), "order 2"),
        (course(order(1, 2.0), NONE), refined(Refined { loss: 0.995, trusted: false, ..GAINS }), "order 1"),
        (course(order(1, 2.0), NONE), refined(Refined { has_blocks: true, ..FAILS }), "order 1"),
        // Another order follows if the last one lowered the validation loss and evaluations are left.
        (course(order(1, 2.0), NONE), refined(FAILS), "order 2"),
        (course(order(1, 1.005), fine), refined(FAILS), "Pruning FineSource []"),
        (course(order(1, 2.0), fine), refined(Refined { evaluations: 40, ..GAINS }), "Pruning FineSource []"),
        (course(order(2, 2.0), fine), refined(FAILS), "Pruning FineSource []"),
        // Without validation pairs the order is 8, and nothing is tried.
        (no_best(course(order(0, 0.0), NONE)), refined(FAILS), "order 1"),
        (no_best(course(order(1, f64::INFINITY), NONE)), refined(FAILS), "LastScreening"),
        // Blocks of the first stage, on the lowest order.
        (
            course(order(0, 0.0), NONE),
            refined(FAILS),
            "First FineSource [Crosstalk, UnevenResponse, LightBlur, PartialCoherence]",
        ),
        (trial(First, FineSource, &[Crosstalk], NONE), refined(GAINS), "First FineSource [Crosstalk]"),
        (trial(First, FineSource, &[Crosstalk], NONE), refined(Refined { loss: 0.96, ..GAINS }), "First Crosstalk []"),
        (
            trial(First, FineSource, &[Crosstalk], NONE),
            refined(Refined { evaluations: 40, ..GAINS }),
            "First Crosstalk []",
        ),
        (trial(First, FineSource, &[PartialCoherence], NONE), tried(fine, 0.96), "First PartialCoherence []"),
        (trial(First, FineSource, &[PartialCoherence], NONE), tried(fine, 0.94), "adoption First"),
        (trial(First, LightBlur, &[], NONE), tried(NONE.with(LightBlur), 0.71), "order 1"),
        (trial(First, LightBlur, &[], NONE), tried(NONE.with(LightBlur), 0.69), "adoption First"),
        (
            course(Phase::Adoption(First), fine.with(Crosstalk).with(UnevenResponse).with(LightBlur)),
            refined(FAILS),
            "First PartialCoherence []",
        ),
    ]);
}

#[test]
fn other_trials_and_dust_follow_the_highest_order() {
    let screened = |course| Course { is_screened: true, ..course };
    let dusty = |course| Course { beside_dust: Some(NONE), keeps_dust: true, ..screened(course) };
    let screened_with = |others| Verdict::Screened { others };
    let fine = NONE.with(FineSource);
    check([
        // Pruning, and what it cannot do without.
        (trial(Pruning, FineSource, &[Crosstalk], fine.with(Crosstalk)), tried(NONE, 1.1), "Pruning Crosstalk []"),
        (trial(Pruning, FineSource, &[], fine), tried(NONE, 1.04), "adoption Pruning"),
        (trial(Pruning, FineSource, &[], fine), tried(NONE, 1.06), "Last Varying [Ghost]"),
        (course(Phase::Adoption(Pruning), NONE), refined(FAILS), "Last Varying [Ghost]"),
        // The last stage, without a varying kernel beside several modes.
        (course(Phase::Adoption(Pruning), NONE.with(PartialCoherence)), refined(FAILS), "Pruning PartialCoherence []"),
        (trial(Pruning, PartialCoherence, &[], NONE.with(PartialCoherence)), refined(FAILS), "Last Ghost []"),
        (trial(Last, Varying, &[Ghost], NONE), tried(NONE.with(Varying), 0.91), "Last Ghost []"),
        (trial(Last, Ghost, &[], NONE), Verdict::Unseen, "LastScreening"),
        (trial(Last, Ghost, &[], NONE), tried(NONE.with(Ghost), 0.89), "adoption Last"),
        (screened(trial(Last, Ghost, &[], NONE)), Verdict::Unseen, "Dust"),
        // With other pairs the last stage begins again.
        (course(Phase::LastScreening, NONE), screened_with(false), "Dust"),
        (course(Phase::LastScreening, NONE), screened_with(true), "adoption Last"),
        (no_best(course(Phase::LastScreening, NONE)), screened_with(false), "Done"),
        (no_best(screened(course(Phase::Adoption(Last), NONE))), refined(FAILS), "Done"),
        (screened(course(Phase::Adoption(Last), NONE)), refined(FAILS), "Last Varying [Ghost]"),
        // Dust, what it hid, and dust once more if blocks were found.
        (screened(course(Phase::Dust, fine)), dusted(true, 39, (1.0, 0.5)), "Dust"),
        (screened(course(Phase::Dust, fine)), dusted(false, 7, (1.0, 0.85)), "FinalPruning FineSource []"),
        (
            screened(course(Phase::Dust, fine.with(Crosstalk))),
            dusted(true, 40, (1.0, 0.75)),
            "BehindDust UnevenResponse [LightBlur, PartialCoherence, Varying, Ghost]",
        ),
        (dusty(trial(BehindDust, Ghost, &[], NONE)), tried(NONE.with(Ghost), 0.89), "adoption BehindDust"),
        (dusty(trial(BehindDust, Ghost, &[], NONE)), tried(NONE.with(Ghost), 0.91), "Done"),
        (dusty(trial(BehindDust, Ghost, &[], fine)), Verdict::Unseen, "Dust"),
        (dusty(course(Phase::Dust, fine)), dusted(false, 7, (1.0, 0.99)), "FinalPruning FineSource []"),
        // Final pruning demands as much of the blocks as was demanded of those behind the dust.
        (dusty(trial(FinalPruning, FineSource, &[], fine)), tried(NONE, 1.1), "adoption FinalPruning"),
        (dusty(trial(FinalPruning, FineSource, &[], fine)), tried(NONE, 1.12), "Done"),
        (dusty(course(Phase::Adoption(FinalPruning), NONE.with(Ghost))), refined(FAILS), "Done"),
    ]);
}

#[test]
fn course_without_evaluations_ends_after_adam() {
    let none = Rules { evaluations: 0, ..rules() };
    let next = Course::start(false).next(&none, Verdict::Screened { others: true });
    assert_eq!(next.phase, Phase::Done);
}

#[test]
fn orders_that_are_asked_for_are_all_fitted() {
    let asked = Rules { chooses_order: false, ..rules() };
    assert_eq!(told(&course(order(1, 1.0), NONE).next(&asked, refined(FAILS))), "order 2");
}

#[test]
fn failed_step_starts_anew_once() {
    let failed = || refined(Refined { has_blocks: true, ..FAILS });
    let next = |course: Course, verdict| course.next(&rules(), verdict);
    let again = next(course(order(1, 2.0), NONE), failed());
    assert!(again.restarts);
    let recovered = next(again.clone(), refined(GAINS));
    assert_eq!((told(&recovered).as_str(), recovered.restarts), ("order 1", false));
    assert!(next(recovered, failed()).restarts);
    assert_eq!(told(&next(again, failed())), "order 2");
}

#[test]
fn refinement_ends_after_six_steps_without_a_validation_gain() {
    let mut at = course(order(1, 2.0), NONE);
    let step = |loss| refined(Refined { validated: Some(model(2, NONE, loss)), ..GAINS });
    for loss in [0.995, 0.991, 0.5, 0.6, 0.6, 0.499, 0.6, 0.6, 0.6] {
        assert_eq!(told(&at), "order 1");
        at = at.next(&rules(), step(loss));
    }
    assert_eq!(told(&at), "order 2");
    assert_eq!(at.best.map(|best| best.loss), Some(0.499));
}

#[test]
fn trial_takes_three_steps_and_a_hopeless_one_fewer() {
    let steps = |mut at: Course, blocks: Blocks, losses: &[f64]| {
        let (trial, mut count) = (told(&at), 0);
        while told(&at) == trial {
            let validated = Some(model(10 + count, blocks, losses[count.min(losses.len() - 1)]));
            at = at.next(&rules(), refined(Refined { before: (count > 0).then_some(1.0), validated, ..GAINS }));
            count += 1;
        }
        (count - 1, at.needed)
    };
    let fine = NONE.with(FineSource);
    assert_eq!(steps(trial(First, FineSource, &[], NONE), fine, &[2.0]), (3, NONE));
    // Without a block that the model needs.
    assert_eq!(steps(trial(Pruning, FineSource, &[], fine), NONE, &[3.0]), (1, fine));
    assert_eq!(steps(trial(Pruning, FineSource, &[], fine), NONE, &[3.0, 2.0]), (3, NONE));
    // Modes pass at 0.7; a third of the way is 0.9. Without the blur that they may replace they start from worse.
    let modes = NONE.with(PartialCoherence);
    assert_eq!(steps(trial(First, PartialCoherence, &[], NONE), modes, &[0.95]), (1, NONE));
    assert_eq!(steps(trial(First, PartialCoherence, &[], NONE), modes, &[0.95, 0.85]), (3, NONE));
    let blurred = NONE.with(LightBlur);
    assert_eq!(steps(trial(First, PartialCoherence, &[], blurred), modes.with(LightBlur), &[1.2]), (3, NONE));
    assert_eq!(steps(trial(First, PartialCoherence, &[], blurred), modes.with(LightBlur), &[1.3]), (1, NONE));
}

#[test]
fn needed_block_is_not_left_out_again() {
    let blocks = NONE.with(FineSource).with(Crosstalk);
    let at = trial(Pruning, FineSource, &[Crosstalk], blocks).next(&rules(), tried(NONE.with(Crosstalk), 3.0));
    let at = at.next(&rules(), tried(NONE.with(FineSource), 1.01));
    assert_eq!(told(&at), "adoption Pruning");
    assert_eq!(told(&at.next(&rules(), refined(FAILS))), "Last Varying [Ghost]");
}

#[test]
fn best_trial_of_a_round_wins() {
    let next = |course: Course, verdict| course.next(&rules(), verdict);
    let at = next(trial(First, FineSource, &[Crosstalk, LightBlur], NONE), tried(NONE.with(FineSource), 0.8));
    assert_eq!((at.validation_loss(), at.best().map(|best| best.loss)), (Some(0.8), Some(0.8)));
    let better = Model { number: 3, ..model(3, NONE.with(Crosstalk), 0.6) };
    let at = next(at, refined(Refined { validated: Some(better), ..FAILS }));
    let at = next(at, tried(NONE.with(LightBlur), 0.68));
    assert_eq!((told(&at).as_str(), at.best), ("adoption First", Some(better)));
}

/// What a step might come to.
#[derive(Clone, Debug)]
struct Draw {
    improved: bool,
    trusted: bool,
    is_seen: bool,
    ends: bool,
    /// Training loss and validation loss, relative to those before.
    losses: (f64, f64),
    evaluations: u32,
}

prop_compose! {
    fn draws()(
        flags in prop::array::uniform4(prop::bool::weighted(0.75)),
        losses in (0.3..1.1, prop_oneof![0.5..1.0, 0.98..1.02, 0.5..3.0]),
        evaluations in 1..6_u32,
    ) -> Draw {
        let [improved, trusted, is_seen, goes_on] = flags;
        Draw { improved, trusted, is_seen, ends: !goes_on, losses, evaluations }
    }
}

prop_compose! {
    fn any_rules()(
        orders in 1..4_usize,
        chooses_order: bool,
        blocks in prop::sample::subsequence(Block::ALL.to_vec(), 0..=Block::ALL.len()),
        evaluations in 0..12_u32,
    ) -> Rules {
        Rules { orders: vec![5, 8, 12][..orders].to_vec(), chooses_order, blocks, evaluations }
    }
}

impl Draw {
    /// The verdict on the work of a phase whose refinement has taken so many evaluations.
    fn verdict(&self, course: &Course, number: usize, evaluations: &mut u32, has_validation: bool) -> Verdict {
        if course.begins() {
            *evaluations = 0;
        }
        let before = course.best.map_or(1.0, |best| best.loss);
        match &course.phase {
            Phase::Adam => Verdict::Adam { is_last: self.ends },
            Phase::Screening | Phase::LastScreening => Verdict::Screened { others: self.ends },
            Phase::Trial(_) if course.begins() && !self.is_seen => Verdict::Unseen,
            Phase::Dust => {
                *evaluations += 1;
                dusted(!self.ends, *evaluations, (before, before * self.losses.1))
            }
            _ => {
                let is_first = course.begins();
                let improved = is_first || self.improved;
                *evaluations += if is_first { 1 } else { self.evaluations * u32::from(improved) };
                let blocks = course.round().map_or(course.best.map_or(NONE, |best| best.blocks), Round::blocks);
                refined(Refined {
                    before: (!is_first).then_some(1.0),
                    loss: self.losses.0,
                    improved,
                    trusted: self.trusted,
                    evaluations: *evaluations,
                    has_blocks: blocks != NONE,
                    validated: has_validation.then(|| model(number, blocks, before * self.losses.1)),
                })
            }
        }
    }
}

/// Place of a course in the documented order.
fn place(course: &Course) -> usize {
    let of_stage = |stage| match stage {
        First => 3,
        Pruning => 20,
        Last => 21 + 2 * usize::from(course.is_screened),
        BehindDust => 25,
        FinalPruning => 27,
    };
    match &course.phase {
        Phase::Adam => 0,
        Phase::Screening => 1,
        Phase::Order { index: 0, .. } => 2,
        Phase::Order { index, .. } => 3 + index,
        Phase::Trial(round) => of_stage(round.stage),
        Phase::Adoption(stage) => of_stage(*stage),
        Phase::LastScreening => 22,
        Phase::Dust => 24 + 2 * usize::from(course.beside_dust.is_some()),
        Phase::Done => 28,
    }
}

/// Most steps of a course after Adam. A refinement has a first step, and each step that gains takes an evaluation; a
/// step that fails ends it or is followed by one that gains. Trials take four steps. Each adoption of a stage changes
/// one block, and there are six stages, as the last one may begin again.
fn steps_max(rules: &Rules) -> usize {
    let (blocks, evaluations) = (rules.blocks.len(), rules.evaluations as usize);
    let (adoptions, trials) = (6 * blocks + 1, 6 * blocks * (blocks + 1));
    2 + (rules.orders.len() + adoptions) * (2 * evaluations + 2) + 4 * trials + 2 * evaluations
}

proptest! {
    #[test]
    fn every_course_ends_in_the_documented_order(
        rules in any_rules(),
        draws in prop::collection::vec(draws(), 1..200),
        has_validation: bool,
    ) {
        let (mut course, mut evaluations, mut steps) = (Course::start(true), 0, 0);
        for (number, draw) in draws.iter().cycle().enumerate() {
            // All draws may say that Adam goes on.
            let draw = Draw { ends: draw.ends || course.phase == Phase::Adam && number > 5, ..draw.clone() };
            let verdict = draw.verdict(&course, number, &mut evaluations, has_validation);
            let next = course.clone().next(&rules, verdict);
            steps += usize::from(course.phase != Phase::Adam);
            prop_assert!(steps <= steps_max(&rules), "{steps} steps by {rules:?}");
            prop_assert!(place(&next) >= place(&course), "{} after {}", told(&next), told(&course));
            prop_assert!(next.obeys(&rules));
            check_models(&course, &next, number)?;
            if let Some(round) = next.round() {
                check_round(&next, round, &rules)?;
            }
            course = next;
            if course.phase == Phase::Done {
                break;
            }
        }
    }
}

/// The best model stays, or a better one takes its place. Only a model with a block less may be a little worse.
fn check_models(course: &Course, next: &Course, number: usize) -> Result<(), TestCaseError> {
    let numbers: Vec<usize> = course.models().map(|model| model.number).chain([number]).collect();
    prop_assert!(next.models().all(|model| numbers.contains(&model.number)));
    let Some(before) = course.best else { return Ok(()) };
    let after = next.best.expect("the best model");
    let most = match course.round().filter(|round| !round.stage.adds()) {
        Some(_) if after.blocks != before.blocks => before.loss / (1.0 - 0.3),
        _ => before.loss,
    };
    prop_assert!(after.loss <= most, "{} after {}", after.loss, before.loss);
    if after.loss > before.loss {
        prop_assert_eq!(after.blocks.iter().count() + 1, before.blocks.iter().count());
    }
    Ok(())
}

/// A round tries only blocks of the model, one at a time, on the best model.
fn check_round(course: &Course, round: &Round, rules: &Rules) -> Result<(), TestCaseError> {
    prop_assert_eq!(Some(round.before), course.best);
    for block in [round.block].iter().chain(&round.untried) {
        prop_assert!(rules.blocks.contains(block) && *block != Block::Dust);
        prop_assert!(round.before.blocks.contains(*block) != round.stage.adds());
        prop_assert!(round.stage.adds() || !course.needed.contains(*block));
    }
    prop_assert!(round.added() != Some(Varying) || !round.before.blocks.contains(Block::PartialCoherence));
    Ok(())
}
