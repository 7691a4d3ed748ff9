//! The optics of a simulated bench: from the rig's file, and else from the server's display.

use crate::device::{DeviceError, Result, SlmFacts};
use lightpath::v1;
use lightpath_bench::SimulatedBench;
use lightpath_optics::display::phase_response::PhaseResponse;
use lightpath_optics::{Carrier, FilterShape, Grid, OpticalSetup, OrderFilter, Orders};

/// What light meets between the source and the camera.
#[derive(Clone, Debug)]
pub struct Optics {
    /// Distance between the centres of the SLM's pixels \[m\].
    pub pixel_pitch_m: f64,
    /// Wavelengths in vacuum \[m\].
    pub wavelengths_m: Vec<f64>,
    /// Distance of the camera's plane from the SLM \[m\].
    pub distance_m: f64,
    /// Size and bits of the SLM.
    pub slm: SlmFacts,
    /// The flaws.
    pub bench: SimulatedBench,
    /// Phase of each level.
    pub response: PhaseResponse,
    /// Grating that is part of every pattern.
    pub carrier: Option<Carrier>,
    /// Diffraction orders that reach the camera.
    pub orders: Orders,
    /// Part of a pixel's side in which the camera sees light.
    pub camera_fill_factor: f64,
}

impl Optics {
    /// The optics of an SLM with a linear response, no grating, and a filter for the first order.
    ///
    /// # Errors
    ///
    /// The SLM has not 1 to 16 bits.
    pub fn plain(
        slm: SlmFacts,
        pixel_pitch_m: f64,
        wavelengths_m: Vec<f64>,
        distance_m: f64,
        bench: SimulatedBench,
    ) -> Result<Self> {
        let response = PhaseResponse::linear(slm.bit_depth).map_err(impossible)?;
        let (carrier, orders, camera_fill_factor) = (None, Orders::First, 1.0);
        Ok(Self { pixel_pitch_m, wavelengths_m, distance_m, slm, bench, response, carrier, orders, camera_fill_factor })
    }

    /// The same with response, grating and orders of the server's display.
    ///
    /// # Errors
    ///
    /// The display has something that this version does not know.
    pub fn of_display(mut self, display: &v1::Display) -> Result<Self> {
        let modulator = display.modulator.clone().unwrap_or_default();
        if let Some(v1::modulator::Kind::Phase(phase)) = modulator.kind
            && !phase.response_rad.is_empty()
        {
            self.response = PhaseResponse::measured(phase.response_rad).map_err(impossible)?;
        }
        self.carrier = match display.carrier() {
            v1::Carrier::Unspecified => None,
            v1::Carrier::HalfOrderX => Some(Carrier::HalfOrderX),
            v1::Carrier::HalfOrderY => Some(Carrier::HalfOrderY),
        };
        self.orders = match &display.orders {
            None | Some(v1::display::Orders::FirstOrder(_)) => Orders::First,
            Some(v1::display::Orders::AllOrders(all)) => Orders::All {
                fill_factor_x: all.fill_factor_x.unwrap_or(1.0),
                fill_factor_y: all.fill_factor_y.unwrap_or(1.0),
            },
            Some(v1::display::Orders::OrderFilter(filter)) => Orders::Filtered(OrderFilter {
                shape: match filter.shape() {
                    v1::order_filter::Shape::Unspecified | v1::order_filter::Shape::Rectangle => FilterShape::Rectangle,
                    v1::order_filter::Shape::Ellipse => FilterShape::Ellipse,
                },
                width: filter.width.unwrap_or(1.0),
                height: filter.height.unwrap_or(1.0),
                centre_x: filter.centre_x,
                centre_y: filter.centre_y,
            }),
        };
        self.camera_fill_factor = display.camera_fill_factor.unwrap_or(1.0);
        Ok(self)
    }

    /// The setup of the engine for a wavelength \[m\], with the propagation that the planner chooses.
    pub(super) fn setup(&self, wavelength_m: f64) -> Result<OpticalSetup> {
        let (height_px, width_px) = (self.slm.height_px as usize, self.slm.width_px as usize);
        let grid = Grid::try_new(height_px, width_px, self.pixel_pitch_m).map_err(impossible)?;
        let setup = OpticalSetup::try_new(grid, wavelength_m, self.distance_m).map_err(impossible)?;
        let setup = setup.with_orders(self.orders).map_err(impossible)?;
        let setup = setup.with_camera_fill_factor(self.camera_fill_factor).map_err(impossible)?;
        Ok(setup.planned().map_err(impossible)?.0)
    }
}

/// An error of the engine in words of this program.
pub(super) fn impossible(error: lightpath_optics::Error) -> DeviceError {
    DeviceError(format!("the simulated bench is not possible: {error}"))
}
