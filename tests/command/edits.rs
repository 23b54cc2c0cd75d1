//! For each kind of edit of a pipeline with a fit, exactly what is done again: stages, patches, exports.

use crate::workshop::{FIT, Workshop};
use serde_json::Value;

/// What happens in a run that ends well, without what is found as it was: "mesh", "fit 0+12" (patches found and made),
/// "part.step".
fn done_again(shop: &Workshop, arguments: &[&str]) -> Vec<String> {
    let ended = shop.topipe(&[&["run", "box.toml", "--json", "--jobs", "1"], arguments].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let mut done = Vec::new();
    let mut patches = String::new();
    for line in ended.stdout.lines() {
        let event: Value = serde_json::from_str(line).unwrap();
        let text = |field: &str| event[field].as_str().unwrap_or_default().to_owned();
        match event["event"].as_str().unwrap() {
            "stage-units" => patches = format!(" {}+{}", event["reused"], event["computed"]),
            "stage-finished" => done.push(text("stage") + &std::mem::take(&mut patches)),
            "export-written" => done.push(text("file")),
            "run-started" | "stage-started" | "stage-progress" | "stage-remark" | "stage-cached"
            | "export-up-to-date" | "run-finished" => {}
            other => panic!("unexpected: {other}"),
        }
    }
    done
}

#[test]
fn each_kind_of_edit_does_again_what_depends_on_it_and_nothing_else() {
    let shop = Workshop::with_part("y-form", FIT);
    let first = done_again(&shop, &[]);
    let patches = first[4].strip_prefix("fit 0+").expect("patches are kept").to_owned();
    assert!(patches.parse::<u32>().unwrap() > 100, "{first:?}");
    let (all_made, all_found) = (format!("fit 0+{patches}"), format!("fit {patches}+0"));
    let (all_made, all_found) = (all_made.as_str(), all_found.as_str());
    assert_eq!(first, ["mesh", "smooth", "tiles", "quads", all_made, "part.step"]);
    let nothing: [&str; 0] = [];
    assert_eq!(done_again(&shop, &[]), nothing);

    // A default written out, another order, a comment, another name of a stage.
    shop.edit("refinements = 0", "# none\nrefinements = 0\ndegree = 3");
    shop.edit("[stage.quads]", "[stage.layout]");
    shop.edit("input = \"quads\"", "input = \"layout\"");
    assert_eq!(done_again(&shop, &[]), nothing);
    // The same file written again, and one that differs where nothing is read: the header of an STL.
    let mesh = std::fs::read(shop.path("part.stl")).unwrap();
    std::fs::write(shop.path("part.stl"), &mesh).unwrap();
    assert_eq!(done_again(&shop, &[]), nothing);
    let mut retitled = mesh.clone();
    retitled[..8].copy_from_slice(b"another ");
    std::fs::write(shop.path("part.stl"), &retitled).unwrap();
    assert_eq!(done_again(&shop, &[]), ["mesh"]);
    // Another export, and another folder for all of them.
    shop.edit("\"part.step\" = \"fit\"", "\"part.step\" = \"fit\"\n\"smooth.stl\" = \"smooth\"");
    assert_eq!(done_again(&shop, &[]), ["smooth.stl"]);
    assert_eq!(done_again(&shop, &["--out", "elsewhere"]), ["part.step", "smooth.stl"]);

    // A parameter of the fit on which no kept patch depends. Then those on which all do: within the tolerance foot points are not
    // corrected again.
    assert_eq!(done_again(&shop, &["--set", "fit.max_normal_jump=5.0"]), [all_found, "part.step"]);
    assert_eq!(done_again(&shop, &["--set", "fit.tolerance=0.5"]), [all_made, "part.step"]);
    assert_eq!(done_again(&shop, &["--set", "fit.lambda=0.9999"]), [all_made, "part.step"]);
    // And back.
    assert_eq!(done_again(&shop, &[]), ["part.step"]);
    // By force nothing is found; the result is the same, so nothing follows.
    assert_eq!(done_again(&shop, &["--force", "fit"]), [all_made]);

    // A parameter at the top goes down to the bottom.
    let smoother = done_again(&shop, &["--set", "smooth.alpha=0.5"]);
    assert_eq!(smoother[..3], ["smooth", "tiles", "layout"]);
    assert!(smoother[3].starts_with("fit "), "{smoother:?}");
    assert_eq!(smoother[4..], ["part.step", "smooth.stl"]);
}
