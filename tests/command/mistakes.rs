//! What a user is told who got something wrong.

use crate::workshop::{Workshop, box_off};

#[test]
fn a_mistake_in_the_pipeline_is_exit_code_2_and_nothing_has_run() {
    let shop = Workshop::new();
    shop.edit("detect_planes", "detect_plains");
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.stderr,
        "error: unknown field `detect_plains` in stage `smooth` (smoothing)\n  --> box.toml:12:1\n   |\n\
         12 | detect_plains = false\n   | ^^^^^^^^^^^^^\n   = help: did you mean `detect_planes`?\n"
    );
    assert!(!shop.path(".topipe").exists() && !shop.path("topipe-out").exists());
}

#[test]
fn a_value_out_of_range_is_found_before_anything_runs() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["run", "box.toml", "--set", "smooth.lambda=7"]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("--> command line:1:21\n"), "{}", ended.stderr);
    assert!(!shop.path(".topipe").exists());
}

#[test]
fn a_newcomer_is_told_what_to_do_next() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["run", "box.off"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.stderr.contains("is a mesh, not a pipeline; write a pipeline for it with `topipe new box.off`")
    );
    std::fs::copy(shop.path("box.off"), shop.path("part.off")).unwrap();
    let ended = shop.topipe(&["plan", "part.toml"]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("`topipe new part.off -o part.toml`"), "{}", ended.stderr);
    let ended = shop.topipe(&["inspect", "box.toml"]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("topipe inspect STAGE --pipeline box.toml"), "{}", ended.stderr);
}

#[test]
fn wrong_command_lines_are_exit_code_2() {
    let shop = Workshop::new();
    for arguments in [
        &["run"][..],
        &["run", "none.toml"],
        &["run", "box.toml", "--set", "smooth"],
        &["run", "box.toml", "--until", "smoth"],
        &["run", "box.toml", "--jobs", "0"],
        &["run", "box.toml", "--only", "check"],
        &["stages", "smothing"],
        &["fly"],
    ] {
        let ended = shop.topipe(arguments);
        assert_eq!(ended.code, 2, "{arguments:?}: {}", ended.stderr);
        assert!(ended.stderr.contains("error: "), "{arguments:?}: {}", ended.stderr);
    }
}

#[test]
fn refused_geometry_is_exit_code_3() {
    let shop = Workshop::new();
    let closed = box_off(1);
    // Without its last face the box is open.
    let lines: Vec<&str> = closed.lines().collect();
    let open =
        closed.replacen("8 6 0", "8 5 0", 1).lines().take(lines.len() - 1).collect::<Vec<_>>().join("\n");
    shop.write("box.off", &open);
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    assert!(
        ended.stderr.starts_with("error: stage `mesh`: box.off: the surface is not closed"),
        "{}",
        ended.stderr
    );
}

#[test]
fn missing_files_and_unusable_folders_are_exit_code_4() {
    let shop = Workshop::new();
    shop.write("file", "");
    assert_eq!(shop.topipe(&["run", "box.toml", "--out", "file"]).code, 4);
    assert_eq!(shop.topipe(&["run", "box.toml", "--cache", "file"]).code, 4);
    std::fs::remove_file(shop.path("box.off")).unwrap();
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 4);
    assert!(ended.stderr.contains("--> box.toml:6:8"), "{}", ended.stderr);
}
