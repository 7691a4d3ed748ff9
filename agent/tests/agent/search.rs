//! How the agent finds the kernel for its optics, and what it says if there is none.

use crate::bench::{Bench, SIZE, check, problem};
use crate::material::kernel;
use lightpath_agent::{Agent, Settings};
use lightpath_manifest::Optics;

/// Number of questions for the list of kernels since the last look.
fn questions(bench: &Bench) -> usize {
    bench.server.take_requests().iter().filter(|request| request.is_for_list()).count()
}

#[test]
fn id_is_asked_for_once_also_over_restarts_and_again_when_it_leads_nowhere() {
    let bench = Bench::new();
    let mut agent = bench.agent();
    check(&mut agent).unwrap();
    assert_eq!(questions(&bench), 1);
    check(&mut agent).unwrap();
    drop(agent);
    let mut agent = bench.agent();
    check(&mut agent).unwrap();
    assert_eq!(questions(&bench), 0);
    // The server calls the kernel otherwise now: ids say nothing.
    bench.server.offer(2, 8, &kernel(2, SIZE));
    bench.server.change(|script| script.kernels = vec!["k_7.2"]);
    check(&mut agent).unwrap();
    bench.assert_uses(2);
    let requests = bench.server.take_requests();
    let paths: Vec<&str> = requests.iter().map(|request| request.path.as_str()).collect();
    assert!(paths.iter().any(|path| path.starts_with("/v1/displays/pluto/kernels/k_7.2/versions/2/")), "{paths:?}");
    // A kernel that is gone is asked for once more at each try.
    bench.server.change(|script| script.kernels = vec![]);
    assert!(problem(&mut agent).starts_with("display pluto has no kernel at 515 nm, 150 mm; it has none; learn one"));
    bench.assert_uses(2);
}

#[test]
fn missing_kernel_says_which_ones_are_there() {
    let bench = Bench::new();
    let settings = Settings { optics: Optics::at_distance(638_000, -12_500_000), ..bench.settings() };
    let found = problem(&mut Agent::start(settings).unwrap());
    assert_eq!(
        found,
        "display pluto has no kernel at 638 nm, -12.5 mm; it has some at 515 nm, 150 mm; learn one with `lightpath kernel \
         learn`, or correct --wavelength and --distance"
    );
}

#[test]
fn list_that_is_none_or_names_something_else_asks_for_the_id() {
    for list in ["<html>", "../../keyring"] {
        let bench = Bench::new();
        bench.server.change(|script| script.kernels = vec![list]);
        let found = problem(&mut bench.agent());
        assert!(
            found.ends_with("has no list of kernels, as a mirror: give the id of the kernel with --kernel"),
            "{found}"
        );
    }
}

#[test]
fn agent_that_is_told_the_id_asks_for_no_list() {
    let bench = Bench::new();
    check(&mut bench.agent_of("515nm-150mm")).unwrap();
    bench.assert_uses(1);
    assert_eq!(questions(&bench), 0);
}
