//! The command `lightpath rig`.

use super::failure::Failure;
use super::jobs::capture_photos::exposure;
use super::session::Session;
use super::show;
use super::table::Table;
use clap::Args;
use lightpath::{names, v1};

commands! {
    /// Commands about rigs: the programs at the benches that show patterns and photograph them.
    RigCommand {
        List(List),
    }
}

/// Show the rigs that are connected to the server, with their SLMs and cameras.
///
/// A rig is lightpath-rig, or another program that speaks its protocol, at the computer with SLM and camera. Each serves
/// one display.
#[derive(Debug, Args)]
pub(crate) struct List {}

impl List {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let answer = session.client.list_rigs(v1::ListRigsRequest {}).await?;
        session.print(&answer, |answer| {
            let mut table = Table::new("display|camera at|wavelengths?|camera?|exposures??|shutter??|program~");
            for rig in &answer.rigs {
                table.row(row(rig));
            }
            table.text_or("no rig is connected; start lightpath-rig at a bench: docs/rig.md")
        })
    }
}

fn row(rig: &v1::Rig) -> [String; 7] {
    let display = rig.name.trim_end_matches("/rig");
    let camera = rig.camera.unwrap_or_default();
    [
        names::id(display).to_owned(),
        show::place(rig.place.as_ref()),
        show::lengths(rig.wavelengths_m.iter().copied()),
        format!("{}×{} px, {} bits", camera.width_px, camera.height_px, camera.bit_depth),
        format!("{} to {}", exposure(camera.exposure_min_s), exposure(camera.exposure_max_s)),
        if rig.has_shutter { "yes" } else { "no" }.to_owned(),
        show::plain(&rig.program),
    ]
}
