//! One message for each mistake, with its place and the way out.

use crate::toy::registry;
use std::path::Path;
use topipe_engine::{Override, Pipeline};

const GOOD: &str = r#"name = "p"
[stage.read]
kind = "read"
path = "in.txt"
[stage.loud]
kind = "append"
input = "read"
times = 2
[stage.size]
kind = "count"
input = "loud"
[export]
"loud.txt" = "loud"
"#;

fn error(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old));
    check(&GOOD.replacen(old, new, 1), &[])
}

fn check(spec: &str, sets: &[&str]) -> String {
    let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Pipeline::parse(Path::new("p.toml"), spec.to_owned(), &overrides, &registry()).unwrap_err().to_string()
}

#[test]
fn the_good_one_is_good() {
    assert!(Pipeline::parse(Path::new("p.toml"), GOOD.to_owned(), &[], &registry()).is_ok());
}

#[test]
fn unknown_field() {
    assert_eq!(
        error("times = 2", "tmies = 2"),
        "error: unknown field `tmies` in stage `loud` (append)\n --> p.toml:8:1\n  |\n8 | tmies = 2\n  | ^^^^^\n  \
         = help: did you mean `times`?"
    );
}

#[test]
fn unknown_field_at_the_top() {
    assert_eq!(
        error("[export]", "[exports]"),
        "error: unknown field `exports`\n  --> p.toml:12:2\n   |\n12 | [exports]\n   |  ^^^^^^^\n   \
         = help: did you mean `export`?"
    );
}

#[test]
fn unknown_kind() {
    assert_eq!(
        error("kind = \"append\"", "kind = \"apend\""),
        "error: unknown kind `apend`\n --> p.toml:6:8\n  |\n6 | kind = \"apend\"\n  |        ^^^^^^^\n  \
         = help: did you mean `append`?"
    );
}

#[test]
fn no_kind() {
    assert_eq!(
        error("kind = \"append\"\n", ""),
        "error: stage `loud` has no `kind`\n --> p.toml:5:8\n  |\n5 | [stage.loud]\n  |        ^^^^\n  \
         = help: possible are `read`, `append`, `count`, `trouble`"
    );
}

#[test]
fn missing_input() {
    assert_eq!(
        error("input = \"read\"\n", ""),
        "error: stage `loud` (append) needs `input`: The text\n --> p.toml:5:8\n  |\n5 | [stage.loud]\n  |        ^^^^\n  \
         = help: add `input = \"STAGE\"` with the name of a stage that makes a text"
    );
}

#[test]
fn missing_file() {
    assert_eq!(
        error("path = \"in.txt\"\n", ""),
        "error: stage `read` (read) needs `path`: The file\n --> p.toml:2:8\n  |\n2 | [stage.read]\n  |        ^^^^\n  \
         = help: add `path = \"FILE\"`"
    );
}

#[test]
fn input_names_no_stage() {
    assert_eq!(
        error("input = \"read\"", "input = \"raed\""),
        "error: there is no stage `raed`\n --> p.toml:7:9\n  |\n7 | input = \"raed\"\n  |         ^^^^^^\n  \
         = help: did you mean `read`?"
    );
}

#[test]
fn input_of_the_wrong_type() {
    assert_eq!(
        error("input = \"read\"", "input = \"size\""),
        "error: `input` of stage `loud` takes a text, but stage `size` makes a number\n --> p.toml:7:9\n  |\n\
         7 | input = \"size\"\n  |         ^^^^^^\n  = help: a text is made by `read`"
    );
}

#[test]
fn input_that_is_no_string() {
    assert_eq!(
        error("input = \"read\"", "input = 3"),
        "error: `input` names a stage: it is a string, not an integer\n --> p.toml:7:9\n  |\n7 | input = 3\n  |         ^"
    );
}

#[test]
fn circle() {
    let spec = GOOD.replace("input = \"read\"", "input = \"more\"")
        + "[stage.more]\nkind = \"append\"\ninput = \"loud\"\n";
    assert_eq!(
        check(&spec, &[]).lines().next().unwrap(),
        // The table of exports ends with the file; the stage after it is read as a stage all the same.
        "error: these stages depend on each other in a circle: `loud` needs `more` needs `loud`"
    );
}

#[test]
fn a_stage_that_needs_itself() {
    assert_eq!(
        error("input = \"read\"", "input = \"loud\""),
        "error: these stages depend on each other in a circle: `loud` needs `loud`\n --> p.toml:7:9\n  |\n\
         7 | input = \"loud\"\n  |         ^^^^^^\n  = help: an input must come from an earlier stage"
    );
}

#[test]
fn value_of_the_wrong_type() {
    assert_eq!(
        error("times = 2", "times = \"two\""),
        "error: invalid type: string \"two\", expected u32 for `times` in stage `loud` (append)\n --> p.toml:8:9\n  |\n\
         8 | times = \"two\"\n  |         ^^^^^"
    );
}

#[test]
fn value_out_of_the_type() {
    assert!(error("times = 2", "times = -1").contains("p.toml:8:9"));
}

#[test]
fn value_out_of_its_range() {
    assert_eq!(
        error("times = 2", "times = 200"),
        "error: `times` is 200, at most 100 is allowed in stage `loud` (append)\n --> p.toml:8:9\n  |\n8 | times = 200\n  \
         |         ^^^"
    );
    assert!(check(GOOD, &["loud.times=300"]).contains("command line:1:18"));
}

#[test]
fn unknown_choice() {
    assert_eq!(
        error("times = 2", "style = \"uper\""),
        "error: unknown value `uper` for `style` in stage `loud` (append)\n --> p.toml:8:9\n  |\n8 | style = \"uper\"\n  \
         |         ^^^^^^\n  = help: did you mean `upper`?"
    );
}

#[test]
fn unknown_field_inside_of_a_table() {
    assert_eq!(
        error("path = \"in.txt\"", "path = \"in.txt\"\nmore = [{ pth = \"x\" }]"),
        "error: unknown field `pth` in stage `read` (read)\n --> p.toml:5:11\n  |\n5 | more = [{ pth = \"x\" }]\n  |           ^^^\n  \
         = help: did you mean `path`?"
    );
}

#[test]
fn infinite_number() {
    assert_eq!(
        error("times = 2", "weight = inf"),
        "error: `weight` is not a finite number\n --> p.toml:8:10\n  |\n8 | weight = inf\n  |          ^^^"
    );
    assert!(error("times = 2", "weight = nan").starts_with("error: `weight` is not a finite number"));
    assert!(error("times = 2", "weight = 1e999").starts_with("error: `weight` is not a finite number"));
}

#[test]
fn export_of_no_stage() {
    assert_eq!(
        error("= \"loud\"\n", "= \"laud\"\n").lines().next().unwrap(),
        "error: there is no stage `laud`"
    );
    assert_eq!(
        check(&GOOD.replace("\"loud.txt\" = \"loud\"", "\"loud.txt\" = \"luod\""), &[]),
        "error: there is no stage `luod`\n  --> p.toml:13:14\n   |\n13 | \"loud.txt\" = \"luod\"\n   |              ^^^^^^\n   \
         = help: did you mean `loud`?"
    );
}

#[test]
fn export_with_an_ending_that_nobody_writes() {
    assert_eq!(
        error("\"loud.txt\"", "\"loud.step\""),
        "error: a text (stage `loud`) cannot be written as `loud.step`\n  --> p.toml:13:1\n   |\n\
         13 | \"loud.step\" = \"loud\"\n   | ^^^^^^^^^^^\n   = help: possible endings are `.txt`, `.md`"
    );
}

#[test]
fn exports_stay_in_their_folder() {
    for file in ["../loud.txt", "/tmp/loud.txt", "a/../../loud.txt", "./loud.txt", "a\\\\b.txt"] {
        let message = error("loud.txt", file);
        assert!(message.contains("is not a file in the output folder"), "{message}");
    }
    assert!(error("loud.txt", "run.json").contains("is the record of the run"));
    let twice = error("\"loud.txt\" = \"loud\"", "\"loud.txt\" = \"loud\"\n\"LOUD.txt\" = \"loud\"");
    assert!(twice.contains("may be the same file"), "{twice}");
}

#[test]
fn text_that_is_not_toml() {
    let message = error("times = 2", "times = = 2");
    assert!(message.contains("p.toml:8:"), "{message}");
    let twice = error("times = 2", "times = 2\ntimes = 3");
    assert!(twice.contains("p.toml:9:1") && twice.contains("duplicate key"), "{twice}");
}

#[test]
fn a_pipeline_without_stages() {
    assert!(check("name = \"p\"\n", &[]).starts_with("error: the pipeline has no stage"));
    assert!(check("", &[]).starts_with("error: the pipeline has no stage"));
}

#[test]
fn mistakes_on_the_command_line_point_there() {
    assert_eq!(
        check(GOOD, &["loud.tmies=3"]),
        "error: unknown field `tmies` in stage `loud` (append)\n --> command line:1:12\n  |\n\
         1 | --set loud.tmies=3\n  |            ^^^^^\n  = help: did you mean `times`?"
    );
    assert_eq!(
        check(GOOD, &["luod.times=3"]),
        "error: there is no stage `luod`\n --> command line:1:7\n  |\n1 | --set luod.times=3\n  |       ^^^^\n  \
         = help: did you mean `loud`?"
    );
    assert_eq!(
        check(GOOD, &["loud.times=many"]),
        "error: invalid type: string \"many\", expected u32 for `times` in stage `loud` (append)\n --> command line:1:18\n  \
         |\n1 | --set loud.times=\"many\"\n  |                  ^^^^^^"
    );
    assert!(check(GOOD, &["loud.kind=count"]).starts_with("error: the kind of a stage cannot be set"));
    assert!(check(GOOD, &["loud.input=size"]).contains("takes a text, but stage `size` makes a number"));
}
