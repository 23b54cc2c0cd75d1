//! Which stages run after which edit.

use crate::toy::{CHAIN, Workshop};
use topipe_engine::{Action, Choice, Reason};

const NOTHING: [&str; 6] = [
    "read cached",
    "soft cached",
    "loud cached",
    "size cached",
    "loud.txt up to date",
    "size.json up to date",
];

#[test]
fn the_first_run_does_everything_in_order() {
    let shop = Workshop::new(CHAIN);
    let (record, log) = shop.run();
    assert_eq!(
        log,
        [
            "run chain: read soft loud size",
            "read starts: never run",
            "read finished",
            "soft starts: never run",
            "soft remarks: appending",
            "soft finished",
            "loud starts: never run",
            "loud remarks: appending",
            "loud finished",
            "size starts: never run",
            "size finished",
            "loud.txt written",
            "size.json written",
            "done",
        ]
    );
    assert_eq!(record.exit_code, 0);
    assert_eq!(shop.out("loud.txt"), "hello.!");
    assert_eq!(shop.out("size.json"), "7");
}

#[test]
fn the_second_run_does_nothing() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    assert_eq!(shop.log(), NOTHING);
}

#[test]
fn an_edited_parameter_reruns_what_depends_on_it() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("input = \"soft\"", "input = \"soft\"\ntimes = 2");
    let log = shop.log();
    assert_eq!(log[..3], ["read cached", "soft cached", "loud starts: times: 1 -> 2"]);
    assert_eq!(log[3..5], ["loud remarks: appending", "loud finished"]);
    assert!(log[5].starts_with("size starts: input `input` changed: "), "{}", log[5]);
    assert_eq!(log[6..], ["size finished", "loud.txt written", "size.json written"]);
    assert_eq!(shop.out("loud.txt"), "hello.!!");
}

#[test]
fn a_result_that_stays_the_same_stops_the_edit_there() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    // `weight` has no effect: `soft` must run to find that out, nothing after it.
    shop.edit("suffix = \".\"", "suffix = \".\"\nweight = 2.0");
    assert_eq!(
        shop.log(),
        [
            "read cached",
            "soft starts: weight: 0.5 -> 2.0",
            "soft remarks: appending",
            "soft finished",
            "loud cached",
            "size cached",
            "loud.txt up to date",
            "size.json up to date",
        ]
    );
}

#[test]
fn going_back_is_a_hit() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("suffix = \".\"", "suffix = \";\"");
    shop.run();
    shop.edit("suffix = \";\"", "suffix = \".\"");
    let log = shop.log();
    assert_eq!(log[..4], NOTHING[..4]);
    // The size is the same for both, so only one of the exports goes back.
    assert_eq!(log[4..], ["loud.txt written", "size.json up to date"]);
    assert_eq!(shop.out("loud.txt"), "hello.!");
}

#[test]
fn writing_a_default_out_changes_nothing() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("input = \"soft\"", "input = \"soft\"\ntimes = 1\nweight = 5e-1\nstyle = \"as-is\"");
    assert_eq!(shop.log(), NOTHING);
}

#[test]
fn renaming_stages_and_moving_everything_changes_nothing() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("\"soft\"", "\"gentle\"");
    shop.edit("[stage.soft]", "[stage.gentle]");
    std::fs::create_dir(shop.path("elsewhere")).unwrap();
    std::fs::rename(shop.path("in.txt"), shop.path("elsewhere/other.txt")).unwrap();
    shop.edit("in.txt", "elsewhere/other.txt");
    assert_eq!(shop.log()[..4], ["read cached", "gentle cached", "loud cached", "size cached"]);
}

#[test]
fn a_file_counts_by_its_content() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.write("in.txt", "hello");
    assert_eq!(shop.log(), NOTHING);
    shop.write("in.txt", "HELLO");
    assert!(shop.log()[0].starts_with("read starts: file `path` changed: "));
    assert_eq!(shop.out("loud.txt"), "HELLO.!");
}

#[test]
fn nested_files_count_by_their_content_and_not_by_their_name() {
    let shop = Workshop::new(CHAIN);
    shop.write("more.txt", " there");
    shop.edit("path = \"in.txt\"", "path = \"in.txt\"\nmore = [{ path = \"more.txt\" }]");
    shop.run();
    assert_eq!(shop.out("loud.txt"), "hello there.!");
    shop.write("same.txt", " there");
    shop.edit("more.txt", "same.txt");
    assert_eq!(shop.log(), NOTHING);
    shop.write("same.txt", " again");
    let log = shop.log();
    assert!(log[0].starts_with("read starts: file `/more/0/path` changed: "), "{}", log[0]);
    assert_eq!(shop.out("loud.txt"), "hello again.!");
}

#[test]
fn values_from_the_command_line_stand_in_for_the_spec() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let log = shop.log_with(&["loud.suffix=?", "loud.style=upper"]);
    assert_eq!(log[2], "loud starts: suffix: \"!\" -> \"?\"; style: \"as-is\" -> \"upper\"");
    assert_eq!(shop.out("loud.txt"), "HELLO.?");
    assert_eq!(shop.log()[..4], NOTHING[..4]);
}

#[test]
fn the_plan_says_what_the_run_then_does() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("suffix = \".\"", "suffix = \"..\"");
    let plan = shop.plan(&Choice::default());
    let actions: Vec<&Action> = plan.stages.iter().map(|stage| &stage.action).collect();
    let on = |name: &str| Action::Depends { on: vec![name.into()] };
    assert_eq!(actions, [&Action::Cached, &Action::Run, &on("soft"), &on("loud")]);
    let suffix = Reason::Parameter {
        field: "suffix".into(),
        old: serde_json::json!("."),
        new: serde_json::json!(".."),
    };
    assert_eq!(plan.stages[1].reasons, [suffix]);

    let (record, _) = shop.run();
    for (planned, ran) in plan.stages.iter().zip(&record.stages) {
        assert_eq!(planned.stage, ran.stage);
        if planned.key.is_some() {
            assert_eq!(planned.key, ran.key);
        }
    }
    assert!(shop.plan(&Choice::default()).stages.iter().all(|stage| stage.action == Action::Cached));
}

#[test]
fn planning_leaves_no_trace_in_results_or_records() {
    let shop = Workshop::new(CHAIN);
    let first = shop.plan(&Choice::default());
    assert_eq!(first, shop.plan(&Choice::default()));
    assert!(!shop.options.out.exists());
    assert!(shop.cache().records(&mut Vec::new()).unwrap().is_empty());
}

#[test]
fn the_record_of_a_run_tells_what_a_cached_stage_once_said() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let (record, _) = shop.run();
    assert_eq!(record.stages[1].remarks, ["appending"]);
    let written: serde_json::Value = serde_json::from_str(&shop.out("run.json")).unwrap();
    assert_eq!(written["stages"][1]["outcome"], "cached");
    assert_eq!(written["stages"][1]["parameters"]["suffix"], ".");
    assert_eq!(written["stages"][2]["inputs"]["input"]["stage"], "soft");
    assert_eq!(written["stages"][2]["inputs"]["input"]["artifact"], written["stages"][1]["artifact"]);
    assert!(written["stages"][1]["artifact"].is_string());
    assert_eq!(written["exit_code"], 0);
}
