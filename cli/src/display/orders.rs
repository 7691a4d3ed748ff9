//! The options that say which diffraction orders a display shows, and their description.

use crate::failure::Failure;
use crate::words::WordParser;
use clap::Args;
use lightpath::Words;
use lightpath::v1::{self, Display, display, order_filter};

/// Options for the diffraction orders of a display.
#[derive(Debug, Args)]
pub(super) struct Options {
    /// Say which diffraction orders of the pixels reach the image: first behind optics that filter them, such as a 4f
    /// relay with a stop, and all without a filter
    ///
    /// The orders are λz/pitch apart. Holograms are optimized through all orders that the display shows.
    #[arg(long, value_enum, default_value_t = Orders::First)]
    orders: Orders,

    /// Set the side of a pixel's bright area in pixel pitches, along x and y, 0.1 to 1: one number, or two like
    /// 0.93x0.9
    #[arg(long, value_name = "X[xY]", value_parser = sides, default_value = "1")]
    fill_factor: Sides,

    /// Set the opening of the filter that passes a part of the first order, along x and y, 0.1 to 1 orders each: one
    /// number, or two like 1x0.5 [default: the whole first order]
    ///
    /// In the focal plane of a lens of focal length f, an order takes λf/pitch. Holograms are optimized through the
    /// filter.
    #[arg(long, value_name = "X[xY]", value_parser = sides, help_heading = "Filter of the first order")]
    filter: Option<Sides>,

    /// Set the middle of the filter's opening in orders, along x and y, for example 0,0.25; the opening lies within the
    /// first order
    ///
    /// X and Y count from the middle of the image's spectrum. A carrier moves this middle by half an order.
    #[arg(
        long,
        value_name = "X,Y",
        value_parser = filter_centre,
        default_value = "0,0",
        allow_hyphen_values = true,
        help_heading = "Filter of the first order"
    )]
    filter_centre: FilterCentre,

    /// Set the shape of the filter's opening [default: rectangle]
    #[arg(long, value_parser = WordParser::<order_filter::Shape>::new(), help_heading = "Filter of the first order")]
    filter_shape: Option<order_filter::Shape>,
}

impl Options {
    /// The message of the orders; `None`: the whole first order.
    ///
    /// # Errors
    ///
    /// [`Failure::Usage`] for options that contradict each other.
    pub(super) fn message(&self) -> Result<Option<display::Orders>, Failure> {
        let Sides([fill_factor_x, fill_factor_y]) = self.fill_factor;
        let is_placed = self.filter_centre != FilterCentre([0.0; 2]) || self.filter_shape.is_some();
        let problem = match (self.orders, self.filter) {
            (Orders::All, None) if !is_placed => {
                let all = v1::AllOrders { fill_factor_x: Some(fill_factor_x), fill_factor_y: Some(fill_factor_y) };
                return Ok(Some(display::Orders::AllOrders(all)));
            }
            (Orders::All, _) => "--orders all is given, but a filter lets only a part of the first order through",
            (Orders::First, _) if self.fill_factor != Sides([1.0, 1.0]) => {
                "--fill-factor is given, but it has no effect without --orders all"
            }
            (Orders::First, Some(Sides([width, height]))) => {
                let FilterCentre([centre_x, centre_y]) = self.filter_centre;
                let shape = self.filter_shape.unwrap_or(order_filter::Shape::Rectangle).into();
                let (width, height) = (Some(width), Some(height));
                let filter = v1::OrderFilter { shape, width, height, centre_x, centre_y };
                return Ok(Some(display::Orders::OrderFilter(filter)));
            }
            (Orders::First, None) if is_placed => {
                "--filter-centre or --filter-shape is given, but they have no effect without --filter"
            }
            (Orders::First, None) => return Ok(None),
        };
        Err(Failure::Usage(problem.to_owned()))
    }
}

/// Diffraction orders that a display shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Orders {
    /// The first order, behind optics that filter the others
    First,
    /// All orders of the pixels, without a filter
    All,
}

/// Sides along x and y: of a pixel in pixel pitches, or of a filter in orders.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sides([f64; 2]);

/// Parses `0.93`, or `0.93x0.9`.
fn sides(text: &str) -> Result<Sides, String> {
    let side = |text: &str| {
        let value = text.parse().ok().filter(|value| (0.1..=1.0).contains(value));
        value.ok_or_else(|| format!("\"{text}\" must be a number from 0.1 to 1"))
    };
    let (x, y) = text.split_once('x').unwrap_or((text, text));
    Ok(Sides([side(x)?, side(y)?]))
}

/// Middle of a filter's opening along x and y, in orders.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FilterCentre([f64; 2]);

/// Parses `0,0.25`.
fn filter_centre(text: &str) -> Result<FilterCentre, String> {
    let place = |text: &str| {
        let value = text.trim().parse().ok().filter(|value| (-0.5..=0.5).contains(value));
        value.ok_or_else(|| format!("\"{text}\" must be a number from -0.5 to 0.5"))
    };
    let (x, y) = text.split_once(',').ok_or("it must be two numbers, for example 0,0.25")?;
    Ok(FilterCentre([place(x)?, place(y)?]))
}

/// Description of the orders that a display shows.
pub(super) fn text(display: &Display) -> String {
    match &display.orders {
        None | Some(display::Orders::FirstOrder(_)) => "first".to_owned(),
        Some(display::Orders::AllOrders(all)) => {
            format!("all, fill factor {}x{}", all.fill_factor_x(), all.fill_factor_y())
        }
        Some(display::Orders::OrderFilter(filter)) => {
            let v1::OrderFilter { centre_x, centre_y, .. } = filter;
            let (width, height, shape) = (filter.width(), filter.height(), filter.shape().word());
            format!("first, through a filter of {width}x{height} orders around {centre_x},{centre_y} ({shape})")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filter_centre_is_two_numbers() {
        assert_eq!(filter_centre("0,-0.25"), Ok(FilterCentre([0.0, -0.25])));
        assert!(filter_centre("0.25").unwrap_err().contains("two numbers"));
        assert!(filter_centre("0,0.7").unwrap_err().contains("\"0.7\" must be a number from -0.5 to 0.5"));
    }

    #[test]
    fn sides_are_one_number_or_two() {
        assert_eq!(sides("0.93"), Ok(Sides([0.93, 0.93])));
        assert_eq!(sides("0.93x1"), Ok(Sides([0.93, 1.0])));
        assert!(sides("0.9x1.2").unwrap_err().contains("\"1.2\" must be a number from 0.1 to 1"));
    }
}
