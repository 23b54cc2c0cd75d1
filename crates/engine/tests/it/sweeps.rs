//! `[sweep]`: many variants as one graph.

use crate::toy::{CHAIN, Workshop};
use topipe_engine::{Pipeline, SweepTable};

fn shop(sweep: &str) -> Workshop {
    Workshop::new(&format!("{CHAIN}\n[sweep]\n{sweep}\n"))
}

fn table(shop: &Workshop) -> SweepTable {
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 0, "{log:#?}");
    SweepTable::new(&shop.pipeline(&[]), &record, &shop.cache(), &[("number", "")]).unwrap()
}

#[test]
fn what_variants_share_is_computed_once() {
    let shop = shop(r#"grid = { "soft.suffix" = [".", ";"], "loud.times" = [1, 2] }"#);
    let log = shop.log();
    let started: Vec<&str> =
        log.iter().filter_map(|line| line.split_once(" starts")).map(|(stage, _)| stage).collect();
    assert_eq!(
        started,
        [
            "read",
            "soft[suffix=.]",
            "loud[suffix=.,times=1]",
            "size[suffix=.,times=1]",
            "loud[suffix=.,times=2]",
            "size[suffix=.,times=2]",
            "soft[suffix=;]",
            "loud[suffix=;,times=1]",
            "size[suffix=;,times=1]",
            "loud[suffix=;,times=2]",
            "size[suffix=;,times=2]",
        ]
    );
    let exported: Vec<(String, String)> =
        ["suffix=.,times=1", "suffix=.,times=2", "suffix=-,times=1", "suffix=-,times=2"]
            .map(|folder| (shop.out(&format!("{folder}/loud.txt")), shop.out(&format!("{folder}/size.json"))))
            .into();
    let expected = [("hello.!", "7"), ("hello.!!", "8"), ("hello;!", "7"), ("hello;!!", "8")];
    assert_eq!(exported, expected.map(|(a, b)| (a.to_owned(), b.to_owned())));
    let again = shop.log();
    assert!(
        again.iter().all(|line| line.ends_with(" cached") || line.ends_with(" up to date")),
        "{again:#?}"
    );
}

#[test]
fn an_edit_of_one_value_reruns_one_variant() {
    let shop = shop(r#"grid = { "loud.times" = [1, 2, 3] }"#);
    shop.run();
    shop.edit("[1, 2, 3]", "[1, 2, 4]");
    let log = shop.log();
    let started: Vec<&String> = log.iter().filter(|line| line.contains(" starts")).collect();
    assert_eq!(started, ["loud[times=4] starts: never run", "size[times=4] starts: never run"]);
}

#[test]
fn zip_takes_values_side_by_side_and_cases_have_names() {
    let shop = shop(
        "zip = { \"soft.suffix\" = [\".\", \"..\"], loud.times = [3, 4] }\n\
         cases = [{ name = \"plain\" }, { name = \"big\", loud.style = \"upper\" }]\n\
         figures = [\"loud.x\"]",
    );
    let pipeline = shop.pipeline(&[]);
    let names: Vec<&str> =
        pipeline.sweep.as_ref().unwrap().variants.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "plain,suffix=.,times=3",
            "plain,suffix=..,times=4",
            "big,suffix=.,times=3",
            "big,suffix=..,times=4"
        ]
    );
    shop.run();
    assert_eq!(shop.out("big,suffix=..,times=4/loud.txt"), "HELLO..!!!!");
    assert_eq!(shop.out("plain,suffix=.,times=3/loud.txt"), "hello.!!!");
}

#[test]
fn the_table_has_values_and_figures() {
    let shop = shop(r#"grid = { "soft.suffix" = [".", "a, \"b\""] }"#);
    shop.edit("[sweep]", "[sweep]\nfigures = [\"size.none\"]");
    let table = table(&shop);
    assert_eq!(table.header, ["variant", "soft.suffix", "size.none"]);
    assert_eq!(
        table.csv(),
        "variant,soft.suffix,size.none\nsuffix=.,.,\n\"suffix=a,--b-\",\"a, \"\"b\"\"\",\n"
    );
    assert!(table.text().starts_with("variant        suffix  none\nsuffix=."), "{}", table.text());
}

#[test]
fn all_variants_of_a_stage_are_chosen_by_its_name() {
    let shop = shop(r#"grid = { "soft.suffix" = [".", ";"] }"#);
    let (_, log) = shop.run_until("soft");
    assert_eq!(log[0], "run chain: read soft[suffix=.] soft[suffix=;]");
}

#[test]
fn the_command_line_has_the_last_word() {
    let shop = shop(r#"grid = { "soft.suffix" = [".", ";"] }"#);
    let log = shop.log_with(
        &["soft.suffix=?", "loud.suffix="]
            .map(|set| set.to_owned() + if set.ends_with('=') { "\"\"" } else { "" })
            .iter()
            .map(String::as_str)
            .collect::<Vec<_>>(),
    );
    let started = log.iter().filter(|line| line.starts_with("soft") && line.contains("starts")).count();
    assert_eq!(started, 1, "{log:#?}");
    // Nothing is called by a value that it does not have, and what no longer differs is one.
    let pipeline = shop.pipeline(&["soft.suffix=\"x\""]);
    let names: Vec<&str> =
        pipeline.sweep.as_ref().unwrap().variants.iter().map(|variant| variant.name.as_str()).collect();
    assert_eq!(names, ["suffix=x"]);
}

fn error(sweep: &str) -> String {
    let shop = shop(sweep);
    match Pipeline::load(&shop.path("p.toml"), &[], &shop.registry) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string().replace(shop.folder().to_str().unwrap(), ""),
    }
}

#[test]
fn mistakes_are_told_with_their_place() {
    let told = |sweep: &str, parts: &[&str]| {
        let error = error(sweep);
        for part in parts {
            assert!(error.contains(part), "no `{part}` in\n{error}");
        }
    };
    told(
        r#"grid = { "luod.times" = [1] }"#,
        &["there is no stage `luod`", "did you mean `loud`?", "          ^^^^"],
    );
    told(
        r#"grid = { "loud.tmies" = [1] }"#,
        &["unknown field `tmies` in stage `loud` (append)", "did you mean `times`?", "               ^^^^^"],
    );
    told(
        r#"grid = { "loud.times" = [1, "many"] }"#,
        &["invalid type: string \"many\", expected u32", "                            ^^^^^^"],
    );
    told(r#"grid = { "loud.times" = 3 }"#, &["what a sweep gives a field is a list, not an integer"]);
    told(r#"grid = { "loud.times" = [] }"#, &["is empty"]);
    told(r#"grid = { loud = [1] }"#, &["`loud` is not of the form STAGE.FIELD"]);
    told(r#"zip = { "loud.times" = [1, 2], "soft.times" = [1] }"#, &["have different lengths: 2, 1"]);
    told(r#"grdi = {}"#, &["unknown field `grdi` in `sweep`", "did you mean `grid`?"]);
    told(
        r#"cases = [{ name = "a" }, { name = "a" }]"#,
        &["cannot be the name of a case, or is that of another"],
    );
    told(r#"figures = ["check.x"]"#, &["there is no stage `check` to take a figure from"]);
    told(r#"figures = ["size"]"#, &["`size` is not of the form STAGE.FIGURE"]);
    let many: Vec<String> = (0..200).map(|k| k.to_string()).collect();
    let list = many.join(",");
    told(
        &format!("grid = {{ \"loud.times\" = [{list}], \"soft.times\" = [{list}] }}"),
        &["more than 10000 variants"],
    );
}
