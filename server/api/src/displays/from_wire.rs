//! Checks of displays that clients declare.

use super::simulated_bench;
use crate::enumerations::WireField as _;
use crate::names;
use lightpath_domain::display::Display;
use lightpath_domain::units::Wavelength;
use lightpath_optics::{OpticalSetup, OrderFilter, Orders};
use lightpath_proto::v1::{self, display, modulator};
use lightpath_service::{Call, Field, Result, check_all, collect_all};
use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

/// Allowed sides of an SLM \[px\]. Smaller sides hardly diffract. Larger SLMs do not exist, and their padded fields
/// would not fit into memory.
const SIDE_PX: RangeInclusive<u32> = 16..=8192;
/// Allowed pixel pitches \[m\]: those of SLMs, with some margin.
const PIXEL_PITCH_M: RangeInclusive<f64> = 1e-7..=1e-3;
/// Allowed bits per grey level: what a 16-bit PNG can hold.
const BIT_DEPTH: RangeInclusive<u32> = 1..=16;
/// Limit on the wavelengths of a display, above that of any multi-colour projector.
const WAVELENGTHS_MAX: usize = 16;
/// Largest phase in a response \[rad\], at which f32 still resolves a thousandth.
const PHASE_RAD_MAX: f64 = 1000.0;
/// Largest span of a response \[rad\], 16 turns: no modulator has so many, and 180 degrees or 8-bit levels are more.
const PHASE_SPAN_RAD_MAX: f64 = 100.0;
/// Smallest number of levels whose phases cannot all be whole numbers by chance.
const WHOLE_NUMBERS_MIN: usize = 8;
/// Allowed sides of what a camera sees of a pixel, in pixel pitches.
const CAMERA_FILL_FACTOR: RangeInclusive<f64> = OpticalSetup::CAMERA_FILL_FACTOR_MIN..=1.0;
/// Limit on the length of the notes \[bytes\]: a page of text.
const NOTES_BYTES_MAX: usize = 4096;

/// Checks a display from a client and converts it.
pub(crate) fn display(call: &Call, message: v1::Display, field: &Field) -> Result<Display> {
    let at = |name| field.at(name);
    let bench = message.bench.map(|display::Bench::SimulatedBench(bench)| bench);
    check_all! {
        id = names::display_id(call, &at("name"), &message.name);
        modulator = at("modulator").required(message.modulator).and_then(|message| modulator(message, &at("modulator")));
        wavelengths = wavelengths(&at("wavelengths_m"), &message.wavelengths_m);
        carrier = at("carrier").enum_value(message.carrier);
        orders = match message.orders {
            None | Some(display::Orders::FirstOrder(_)) => Ok(Orders::First),
            Some(display::Orders::AllOrders(all)) => all_orders(&at("all_orders"), all, message.carrier != 0),
            Some(display::Orders::OrderFilter(filter)) => order_filter(&at("order_filter"), filter),
        };
        camera_fill_factor = at("camera_fill_factor").number_or(message.camera_fill_factor, 1.0, CAMERA_FILL_FACTOR);
        notes = notes(&at("notes"), message.notes);
        simulated_bench = bench.map(|bench| simulated_bench::from_wire(bench, &at("simulated_bench"))).transpose();
    }
    let Modulator { width_px, height_px, pixel_pitch_m, bit_depth, phase_response_rad } = modulator;
    Ok(Display {
        id,
        width_px,
        height_px,
        pixel_pitch_m,
        bit_depth,
        wavelengths,
        phase_response_rad,
        carrier,
        orders,
        camera_fill_factor,
        notes,
        simulated_bench,
    })
}

/// Checks the notes of a display.
pub(super) fn notes(field: &Field, given: String) -> Result<String> {
    field.lines(given, NOTES_BYTES_MAX)
}

/// What a message says of a modulator.
struct Modulator {
    width_px: u32,
    height_px: u32,
    pixel_pitch_m: f64,
    bit_depth: u32,
    phase_response_rad: Option<Vec<f64>>,
}

fn modulator(message: v1::Modulator, field: &Field) -> Result<Modulator> {
    let at = |name| field.at(name);
    let bit_depth = at("bit_depth").integer_or(message.bit_depth, 8, BIT_DEPTH);
    let response_rad = message.kind.map(|modulator::Kind::Phase(phase)| phase.response_rad).unwrap_or_default();
    let response = match &bit_depth {
        Ok(bits) if !response_rad.is_empty() => {
            response(&at("phase").at("response_rad"), response_rad, *bits).map(Some)
        }
        // Without a bit depth the right number of entries is unknown.
        _ => Ok(None),
    };
    check_all! {
        width_px = at("width_px").integer(message.width_px, SIDE_PX);
        height_px = at("height_px").integer(message.height_px, SIDE_PX);
        pixel_pitch_m = pixel_pitch(&at("pixel_pitch_x_m"), message.pixel_pitch_x_m);
        square = same_pitch(&at("pixel_pitch_y_m"), message.pixel_pitch_y_m, message.pixel_pitch_x_m);
        bit_depth = bit_depth;
        phase_response_rad = response;
    }
    let () = square;
    Ok(Modulator { width_px, height_px, pixel_pitch_m, bit_depth, phase_response_rad })
}

/// Refuses pixels that are not square: nothing computes their light.
fn same_pitch(field: &Field, pitch_y_m: Option<f64>, pitch_x_m: f64) -> Result<()> {
    let checked = field.if_set(pitch_y_m, "the same pitch", |pitch_y_m| match pitch_y_m == pitch_x_m {
        true => Ok(()),
        false => Err(field
            .but(format!("is {pitch_y_m}"), format!("must be pixel_pitch_x_m, {pitch_x_m}: pixels must be square"))),
    });
    checked.map(Option::unwrap_or_default)
}

fn all_orders(field: &Field, message: v1::AllOrders, has_carrier: bool) -> Result<Orders> {
    if has_carrier {
        return Err(field.but("is given", "a carrier needs optics that let only one half of the orders through"));
    }
    let fill = |name, value| field.at(name).number_or(value, 1.0, Orders::FILL_FACTOR_MIN..=1.0);
    check_all! {
        fill_factor_x = fill("fill_factor_x", message.fill_factor_x);
        fill_factor_y = fill("fill_factor_y", message.fill_factor_y);
    }
    Ok(Orders::All { fill_factor_x, fill_factor_y })
}

fn order_filter(field: &Field, message: v1::OrderFilter) -> Result<Orders> {
    let side = |name, value| field.at(name).number_or(value, 1.0, OrderFilter::SIDE_MIN..=1.0);
    check_all! {
        width = side("width", message.width);
        height = side("height", message.height);
        shape = field.at("shape").enum_value(message.shape);
    }
    let centre = |name, value: f64, side: f64| {
        if OrderFilter::is_inside(value, side) {
            return Ok(value);
        }
        let farthest = OrderFilter::centre_max(side);
        let within = if farthest == 0.0 { "0".to_owned() } else { format!("{:.3} to {farthest:.3}", -farthest) };
        let rule = format!("must be {within}, so that the opening of {side} lies within the first order");
        Err(field.at(name).but(format!("is {value}"), rule))
    };
    check_all! {
        centre_x = centre("centre_x", message.centre_x, width);
        centre_y = centre("centre_y", message.centre_y, height);
    }
    let filter = OrderFilter { shape: shape.unwrap_or_default(), width, height, centre_x, centre_y };
    Ok(Orders::Filtered(filter))
}

fn pixel_pitch(field: &Field, value: f64) -> Result<f64> {
    if PIXEL_PITCH_M.contains(&value) {
        return Ok(value);
    }
    Err(field.but(format!("is {value}"), "must be 1e-7 to 1e-3 m (8e-6 is 8 µm)"))
}

fn wavelengths(field: &Field, values: &[f64]) -> Result<Vec<Wavelength>> {
    if values.is_empty() {
        return Err(field.but("is empty", "a display needs at least one wavelength"));
    }
    if values.len() > WAVELENGTHS_MAX {
        return Err(
            field.but(format!("has {} entries", values.len()), format!("at most {WAVELENGTHS_MAX} are accepted"))
        );
    }
    let checked = |(i, &value)| field.index(i).wavelength(value);
    let mut wavelengths = collect_all(values.iter().enumerate().map(checked))?;
    wavelengths.sort_unstable();
    match wavelengths.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(field.but(format!("names {} twice", pair[0]), "no two may be equal")),
        None => Ok(wavelengths),
    }
}

fn response(field: &Field, phase_rad: Vec<f64>, bit_depth: u32) -> Result<Vec<f64>> {
    let levels = 1_usize << bit_depth;
    if phase_rad.len() != levels {
        let count = phase_rad.len();
        return Err(field.but(format!("has {count} entries"), format!("must have {levels}, one for each level")));
    }
    let is_outside = |phase: &f64| !(-PHASE_RAD_MAX..=PHASE_RAD_MAX).contains(phase);
    if let Some(i) = phase_rad.iter().position(is_outside) {
        field.index(i).number(phase_rad[i], -PHASE_RAD_MAX..=PHASE_RAD_MAX)?;
    }
    require_radians(field, &phase_rad)?;
    Ok(phase_rad)
}

/// Refuses phases that a modulator cannot make, or that look like another quantity, with a question.
fn require_radians(field: &Field, phase_rad: &[f64]) -> Result<()> {
    let least = phase_rad.iter().copied().fold(f64::INFINITY, f64::min);
    let most = phase_rad.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let span = most - least;
    if phase_rad.len() >= WHOLE_NUMBERS_MIN && phase_rad.iter().all(|phase| phase.fract() == 0.0) {
        let problem = format!("has whole numbers only, from {least} to {most}, but must have radians as measured");
        let question = "are they grey levels, such as a driver's table? Then give the phase that each level makes. Are \
                        they degrees? Then multiply them by π/180";
        return Err(field.invalid(problem, question));
    }
    if span > PHASE_SPAN_RAD_MAX {
        let problem = format!("spans {span} rad, {:.0} turns, but a modulator makes a few", span / TAU);
        let question = "are these degrees? Then multiply them by π/180. Are they grey levels? Then give the phase that \
                        each level makes";
        return Err(field.invalid(problem, question));
    }
    if span < PI {
        let question = "are these turns or multiples of π? Then multiply them by 2π or π";
        return Err(field.invalid(format!("spans {span} rad, but must span at least π"), question));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::displays::to_wire;
    use lightpath_store::DisplayRecord;

    const RECORD: DisplayRecord = DisplayRecord { create_time_ms: 1_500, revision: 3 };

    fn message() -> v1::Display {
        v1::Display {
            name: "displays/lab-2".into(),
            modulator: Some(v1::Modulator {
                width_px: 1920,
                height_px: 1080,
                pixel_pitch_x_m: 8e-6,
                pixel_pitch_y_m: None,
                bit_depth: Some(2),
                kind: phase(vec![0.0, 1.0, 2.0, 4.0]),
            }),
            wavelengths_m: vec![639e-9, 515e-9],
            carrier: v1::Carrier::HalfOrderY.into(),
            orders: None,
            camera_fill_factor: None,
            notes: "bench 2".into(),
            bench: bench(v1::SimulatedBench { seed: 7, ..Default::default() }),
            create_time: None,
            revision: 0,
        }
    }

    fn phase(response_rad: Vec<f64>) -> Option<modulator::Kind> {
        Some(modulator::Kind::Phase(v1::PhaseModulator { response_rad }))
    }

    fn bench(bench: v1::SimulatedBench) -> Option<display::Bench> {
        Some(display::Bench::SimulatedBench(bench))
    }

    fn all(fill_factor_x: f64, fill_factor_y: Option<f64>) -> display::Orders {
        display::Orders::AllOrders(v1::AllOrders { fill_factor_x: Some(fill_factor_x), fill_factor_y })
    }

    fn filter(width: Option<f64>, centre_x: f64) -> display::Orders {
        display::Orders::OrderFilter(v1::OrderFilter { width, centre_x, ..Default::default() })
    }

    fn refusal(change: impl Fn(&mut v1::Display)) -> String {
        let mut message = message();
        change(&mut message);
        display(&Call::without_token(), message, &Field::new("display")).unwrap_err().to_string()
    }

    /// The refusal of a display with another modulator.
    fn modulator_refusal(change: impl Fn(&mut v1::Modulator)) -> String {
        refusal(|d| change(d.modulator.as_mut().unwrap()))
    }

    fn with_response(bit_depth: u32, phase_rad: impl Fn(f64) -> f64) -> v1::Display {
        let phase_rad = (0..1 << bit_depth).map(|level| phase_rad(f64::from(level))).collect();
        let mut message = message();
        let modulator = message.modulator.as_mut().unwrap();
        (modulator.bit_depth, modulator.kind) = (Some(bit_depth), phase(phase_rad));
        message
    }

    /// The refusal of a measured response.
    fn measured(bit_depth: u32, phase_rad: impl Fn(f64) -> f64) -> String {
        refusal(|d| *d = with_response(bit_depth, &phase_rad))
    }

    #[test]
    fn responses_of_more_or_less_than_a_turn_are_accepted() {
        for (bit_depth, turns) in [(8, 1.45), (8, 0.8), (10, 6.0), (1, 0.6), (2, 0.955)] {
            let levels = f64::from(1 << bit_depth);
            let message = with_response(bit_depth, |level| turns * TAU * level / (levels - 1.0));
            assert!(display(&Call::without_token(), message, &Field::new("display")).is_ok(), "{bit_depth} {turns}");
        }
    }

    #[test]
    fn displays_survive_conversion_with_defaults_filled_in() {
        let domain = display(&Call::without_token(), message(), &Field::new("display")).unwrap();
        let converted = to_wire::display((domain.clone(), RECORD));
        assert_eq!(converted.wavelengths_m, [515e-9, 639e-9]);
        assert_eq!(
            converted.bench,
            bench(v1::SimulatedBench { seed: 7, strength: Some(1.0), camera_noise: Some(0.003), ..Default::default() })
        );
        assert_eq!(converted.camera_fill_factor, Some(1.0));
        assert_eq!(converted.create_time.unwrap().nanos, 500_000_000);
        assert_eq!(display(&Call::without_token(), converted, &Field::new("display")).unwrap(), domain);
    }

    #[test]
    fn all_orders_survive_conversion_with_defaults_filled_in() {
        // On a simulated display, too.
        let message = v1::Display { orders: Some(all(0.93, None)), carrier: 0, ..message() };
        let domain = display(&Call::without_token(), message, &Field::new("display")).unwrap();
        assert_eq!(domain.orders, Orders::All { fill_factor_x: 0.93, fill_factor_y: 1.0 });
        let converted = to_wire::display((domain.clone(), RECORD));
        assert_eq!(display(&Call::without_token(), converted, &Field::new("display")).unwrap(), domain);
    }

    #[test]
    fn filters_survive_conversion_with_defaults_filled_in() {
        // On a simulated display with a carrier, too.
        let message = v1::Display { orders: Some(filter(Some(0.5), -0.25)), ..message() };
        let domain = display(&Call::without_token(), message, &Field::new("display")).unwrap();
        let expected = OrderFilter { centre_x: -0.25, ..OrderFilter::rectangle(0.5, 1.0) };
        assert_eq!(domain.orders, Orders::Filtered(expected));
        let converted = to_wire::display((domain.clone(), RECORD));
        assert_eq!(display(&Call::without_token(), converted, &Field::new("display")).unwrap(), domain);
    }

    #[test]
    fn all_invalid_fields_are_refused_at_once() {
        let refusal = refusal(|d| {
            let modulator = d.modulator.as_mut().unwrap();
            (modulator.width_px, modulator.pixel_pitch_x_m, modulator.bit_depth) = (15, f64::NAN, Some(17));
            d.wavelengths_m = vec![0.5, 515e-9, 1e-8];
            d.bench = bench(v1::SimulatedBench { strength: Some(-1.0), camera_noise: Some(2.0), ..Default::default() });
        });
        let fields: Vec<&str> = refusal.lines().skip(1).map(|line| line.split_whitespace().next().unwrap()).collect();
        let bench = ["simulated_bench.strength", "simulated_bench.camera_noise"];
        let expected = [
            "modulator.width_px",
            "modulator.pixel_pitch_x_m",
            "modulator.bit_depth",
            "wavelengths_m[0]",
            "wavelengths_m[2]",
        ];
        let expected = expected.iter().chain(&bench).map(|name| format!("display.{name}"));
        assert_eq!(fields, expected.collect::<Vec<_>>(), "{refusal}");
        assert!(refusal.starts_with("7 fields of the request are wrong:\n"), "{refusal}");
    }

    #[test]
    fn invalid_fields_are_refused() {
        for (refusal, start) in [
            (modulator_refusal(|m| m.pixel_pitch_x_m = 0.0), "display.modulator.pixel_pitch_x_m is 0, but"),
            (modulator_refusal(|m| m.pixel_pitch_x_m = -8e-6), "display.modulator.pixel_pitch_x_m is -0.000008, but"),
            (modulator_refusal(|m| m.pixel_pitch_x_m = f64::NAN), "display.modulator.pixel_pitch_x_m is NaN, but"),
            (modulator_refusal(|m| m.width_px = 15), "display.modulator.width_px is 15, but must be 16 to 8192"),
            (modulator_refusal(|m| m.height_px = 8193), "display.modulator.height_px is 8193"),
            (modulator_refusal(|m| m.bit_depth = Some(17)), "display.modulator.bit_depth is 17"),
            (modulator_refusal(|m| m.bit_depth = Some(8)), "display.modulator.phase.response_rad has 4 entries, but"),
            (refusal(|d| d.wavelengths_m.clear()), "display.wavelengths_m is empty"),
            (refusal(|d| d.wavelengths_m[1] = f64::INFINITY), "display.wavelengths_m[1] is inf"),
            (refusal(|d| d.wavelengths_m[1] = 639.000_000_1e-9), "display.wavelengths_m names 639nm twice"),
            (refusal(|d| d.wavelengths_m = vec![5e-7; 17]), "display.wavelengths_m has 17 entries"),
            (refusal(|d| d.carrier = 9), "display.carrier is 9, but must be a value"),
            (refusal(|d| d.orders = Some(all(0.9, None))), "display.all_orders is given, but a carrier"),
            (
                refusal(|d| {
                    d.carrier = 0;
                    d.orders = Some(all(1.2, None));
                }),
                "display.all_orders.fill_factor_x is 1.2, but",
            ),
            (refusal(|d| d.orders = Some(filter(Some(0.05), 0.0))), "display.order_filter.width is 0.05, but"),
            (refusal(|d| d.camera_fill_factor = Some(1.2)), "display.camera_fill_factor is 1.2, but"),
            (refusal(|d| d.camera_fill_factor = Some(f64::NAN)), "display.camera_fill_factor is NaN, but"),
            (
                refusal(|d| d.orders = Some(filter(Some(0.5), 0.26))),
                "display.order_filter.centre_x is 0.26, but must be -0.250 to 0.250, so that the opening of 0.5 lies",
            ),
            (
                refusal(|d| d.orders = Some(filter(None, f64::NAN))),
                "display.order_filter.centre_x is NaN, but must be 0,",
            ),
            (
                modulator_refusal(|m| m.pixel_pitch_y_m = Some(9e-6)),
                "display.modulator.pixel_pitch_y_m is 0.000009, but must be",
            ),
            (refusal(|d| d.modulator = None), "display.modulator is not set, but is required"),
            (refusal(|d| d.notes = "x".repeat(4097)), "display.notes has 4097 bytes"),
            (refusal(|d| d.name = "lab".into()), "display.name is \"lab\", but must be displays/{id}"),
            (
                refusal(|d| d.bench = bench(v1::SimulatedBench { strength: Some(-1.0), ..Default::default() })),
                "display.simulated_bench.strength is -1",
            ),
            (
                modulator_refusal(|m| m.kind = phase(vec![0.0, 1.0, 2.0, 1.5])),
                "display.modulator.phase.response_rad spans 2",
            ),
            (
                modulator_refusal(|m| m.kind = phase(vec![f64::NAN, 1.0, 2.0, 4.0])),
                "display.modulator.phase.response_rad[0] is NaN",
            ),
        ] {
            assert!(refusal.starts_with(start), "{refusal}");
        }
    }

    #[test]
    fn responses_in_another_unit_are_questioned() {
        for (refusal, start) in [
            (
                measured(8, |level| 360.0 * level / 255.0),
                "display.modulator.phase.response_rad spans 360 rad, 57 turns, but",
            ),
            (measured(8, |level| level), "display.modulator.phase.response_rad has whole numbers only, from 0 to 255"),
            (
                measured(4, |level| 24.0 * level),
                "display.modulator.phase.response_rad has whole numbers only, from 0 to 360",
            ),
            (
                measured(8, |level| level * level / 255.0),
                "display.modulator.phase.response_rad spans 255 rad, 41 turns",
            ),
            (
                measured(8, |level| 2.0 * level / 255.0),
                "display.modulator.phase.response_rad spans 2 rad, but must span at",
            ),
            (
                measured(8, |level| 1e4 * level),
                "display.modulator.phase.response_rad[1] is 10000, but must be -1000 to 1000",
            ),
        ] {
            assert!(refusal.starts_with(start), "{refusal}");
        }
    }
}
