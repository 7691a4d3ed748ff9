//! The command `lightpath display update`.

use crate::failure::Failure;
use crate::session::Session;
use clap::Args;
use lightpath::names;
use lightpath::v1::{self, Display};
use pbjson_types::FieldMask;

/// Change the notes of a display.
///
/// Everything else about a display stays as it is, because kernels were learned for it. A display with other optics is a
/// new display.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath display update lab-2 --notes 'new lamp since March'")]
pub(crate) struct Update {
    /// Id of the display
    id: String,

    /// Store this text with the display, at most 4096 bytes; an empty text removes the notes
    #[arg(long, value_name = "TEXT")]
    notes: String,

    /// Change it only if it has this revision, as `display show --output json` says it [default: any]
    #[arg(long, value_name = "N")]
    expected_revision: Option<u32>,
}

impl Update {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = Display { name: names::display(&self.id), notes: self.notes, ..Default::default() };
        let request = v1::UpdateDisplayRequest {
            display: Some(display),
            update_mask: Some(FieldMask { paths: vec!["notes".to_owned()] }),
            expected_revision: self.expected_revision,
        };
        session.print(&session.client.update_display(request).await?, super::facts)
    }
}
