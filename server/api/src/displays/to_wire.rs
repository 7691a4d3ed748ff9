//! Conversion of displays into messages.

use super::simulated_bench;
use crate::enumerations::OnWire;
use crate::time::timestamp;
use lightpath_domain::display::Display;
use lightpath_optics::{OrderFilter, Orders};
use lightpath_proto::v1::{self, display, modulator};
use lightpath_store::DisplayRecord;

/// Converts a display into its message.
pub(crate) fn display((display, record): (Display, DisplayRecord)) -> v1::Display {
    v1::Display {
        name: format!("displays/{}", display.id),
        modulator: Some(v1::Modulator {
            width_px: display.width_px,
            height_px: display.height_px,
            pixel_pitch_x_m: display.pixel_pitch_m,
            pixel_pitch_y_m: Some(display.pixel_pitch_m),
            bit_depth: Some(display.bit_depth),
            kind: Some(modulator::Kind::Phase(v1::PhaseModulator {
                response_rad: display.phase_response_rad.unwrap_or_default(),
            })),
        }),
        wavelengths_m: display.wavelengths.iter().map(|wavelength| wavelength.m()).collect(),
        carrier: display.carrier.map_or(0, OnWire::to_wire),
        orders: orders(display.orders),
        camera_fill_factor: Some(display.camera_fill_factor),
        notes: display.notes,
        bench: display.simulated_bench.map(simulated_bench::to_wire).map(display::Bench::SimulatedBench),
        create_time: Some(timestamp(record.create_time_ms)),
        revision: record.revision,
    }
}

fn orders(orders: Orders) -> Option<display::Orders> {
    match orders {
        Orders::First => Some(display::Orders::FirstOrder(v1::FirstOrder {})),
        Orders::Filtered(OrderFilter { shape, width, height, centre_x, centre_y }) => {
            let (shape, width, height) = (shape.to_wire(), Some(width), Some(height));
            Some(display::Orders::OrderFilter(v1::OrderFilter { shape, width, height, centre_x, centre_y }))
        }
        Orders::All { fill_factor_x, fill_factor_y } => {
            let (fill_factor_x, fill_factor_y) = (Some(fill_factor_x), Some(fill_factor_y));
            Some(display::Orders::AllOrders(v1::AllOrders { fill_factor_x, fill_factor_y }))
        }
    }
}
