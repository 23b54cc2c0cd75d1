//! `--until`, `--from`, `--only`, `--force`.

use crate::toy::{CHAIN, Workshop};
use topipe_engine::{Action, Choice, RunOptions};

fn choose(shop: &Workshop, edit: impl FnOnce(&mut Choice)) -> RunOptions {
    let mut options = shop.options.clone();
    edit(&mut options.choice);
    options
}

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|&name| name.to_owned()).collect()
}

#[test]
fn until_runs_a_stage_and_what_it_needs() {
    let shop = Workshop::new(CHAIN);
    let (record, log) = shop.run_with(&[], &choose(&shop, |choice| choice.until = names(&["loud"])));
    assert_eq!(record.exit_code, 0);
    assert_eq!(log[0], "run chain: read soft loud");
    assert_eq!(log[log.len() - 2..], ["loud.txt written", "done"]);
    assert!(!shop.options.out.join("size.json").exists());
}

#[test]
fn only_takes_everything_else_from_the_cache() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("input = \"soft\"", "input = \"soft\"\ntimes = 2");
    let (record, log) = shop.run_with(&[], &choose(&shop, |choice| choice.only = names(&["loud"])));
    assert_eq!(record.exit_code, 0);
    assert_eq!(
        log,
        [
            "run chain: read soft loud",
            "read cached",
            "soft cached",
            "loud starts: times: 1 -> 2",
            "loud remarks: appending",
            "loud finished",
            "loud.txt written",
            "done",
        ]
    );
}

#[test]
fn only_without_its_inputs_in_the_cache_runs_nothing() {
    let shop = Workshop::new(CHAIN);
    let options = choose(&shop, |choice| choice.only = names(&["loud"]));
    let (record, log) = shop.run_with(&[], &options);
    assert_eq!(record.exit_code, 2);
    assert_eq!(
        log[1],
        "read failed (2): stage `read` is needed but not selected, and its result is not in the cache; \
         run it first with `--until read`"
    );
    assert!(!log.iter().any(|line| line.contains("starts")));
    assert_eq!(shop.plan(&options.choice).stages[0].action, Action::Missing);
}

#[test]
fn from_runs_a_stage_and_what_depends_on_it() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let (record, log) = shop.run_with(&[], &choose(&shop, |choice| choice.from = names(&["loud"])));
    assert_eq!(record.exit_code, 0);
    assert_eq!(log[1..5], ["read cached", "soft cached", "loud cached", "size cached"]);
    let both = choose(&shop, |choice| {
        choice.from = names(&["soft"]);
        choice.until = names(&["loud"]);
    });
    assert_eq!(shop.run_with(&[], &both).1[0], "run chain: read soft loud");
}

#[test]
fn force_runs_a_stage_whose_result_is_known() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let options = choose(&shop, |choice| choice.force = names(&["soft"]));
    let actions: Vec<Action> =
        shop.plan(&options.choice).stages.into_iter().map(|stage| stage.action).collect();
    let on = |name: &str| Action::Depends { on: vec![name.into()] };
    assert_eq!(actions, [Action::Cached, Action::Run, on("soft"), on("loud")]);
    let (_, log) = shop.run_with(&[], &options);
    assert_eq!(
        log[1..6],
        ["read cached", "soft starts: forced", "soft remarks: appending", "soft finished", "loud cached"]
    );
}

#[test]
fn unknown_names_are_told_with_the_nearest_right_one() {
    let shop = Workshop::new(CHAIN);
    let choice = Choice { until: names(&["luod"]), ..Choice::default() };
    let error = topipe_engine::plan(&shop.pipeline(&[]), &shop.cache(), &choice).unwrap_err();
    assert_eq!(error.exit_code().number(), 2);
    assert_eq!(
        error.to_string(),
        "error: there is no stage `luod`\n --> command line:1:9\n  |\n1 | --until luod\n  |         ^^^^\n  \
         = help: did you mean `loud`?"
    );
    let choice = Choice { until: names(&["soft"]), force: names(&["size"]), ..Choice::default() };
    let error = topipe_engine::plan(&shop.pipeline(&[]), &shop.cache(), &choice).unwrap_err();
    assert!(error.to_string().starts_with("error: stage `size` is not part of this run"));
}
