//! Conversion of displays into messages.

use super::simulated_bench;
use crate::enumerations::OnWire;
use crate::time::timestamp;
use lightpath_domain::display::Display;
use lightpath_optics::{OrderFilter, Orders};
use lightpath_proto::v1::{self, display};

/// Converts a display into its message.
pub(crate) fn display(display: Display, create_time_ms: i64) -> v1::Display {
    v1::Display {
        name: format!("displays/{}", display.id),
        width_px: display.width_px,
        height_px: display.height_px,
        pixel_pitch_m: display.pixel_pitch_m,
        bit_depth: display.bit_depth,
        wavelengths_m: display.wavelengths.iter().map(|wavelength| wavelength.m()).collect(),
        phase_response: display.phase_response_rad.map(|phase_rad| v1::PhaseResponse { phase_rad }),
        carrier: display.carrier.map_or(0, OnWire::to_wire),
        orders: orders(display.orders),
        camera_fill_factor: display.camera_fill_factor,
        notes: display.notes,
        simulated_bench: display.simulated_bench.map(simulated_bench::to_wire),
        create_time: Some(timestamp(create_time_ms)),
    }
}

fn orders(orders: Orders) -> Option<display::Orders> {
    match orders {
        Orders::First => None,
        Orders::Filtered(OrderFilter { shape, width, height, centre_x, centre_y }) => {
            let shape = shape.to_wire();
            Some(display::Orders::OrderFilter(v1::OrderFilter { shape, width, height, centre_x, centre_y }))
        }
        Orders::All { fill_factor_x, fill_factor_y } => {
            Some(display::Orders::AllOrders(v1::AllOrders { fill_factor_x, fill_factor_y }))
        }
    }
}
