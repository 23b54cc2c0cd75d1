//! `topipe edit`: what an edit does not touch is taken over, and is not fitted again.

use crate::workshop::Workshop;
use serde_json::Value;

/// The y-form with a pipeline as `topipe new` writes it, which was run.
fn y_form() -> Workshop {
    let shop = Workshop::with_part("y-form", "");
    std::fs::rename(shop.path("part.stl"), shop.path("arm.stl")).unwrap();
    assert_eq!(shop.topipe(&["new", "arm.stl"]).code, 0);
    let run = shop.topipe(&["run", "arm.toml"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    shop
}

/// Writes a binary STL with a bump around the first corner of one of its triangles.
fn bump(shop: &Workshop, from: &str, to: &str, triangle: usize, radius: f32, height: f32) {
    let mut bytes = std::fs::read(shop.path(from)).unwrap();
    let read = |bytes: &[u8], at: usize| {
        [0, 4, 8].map(|k| f32::from_le_bytes(bytes[at + k..at + k + 4].try_into().unwrap()))
    };
    let center = read(&bytes, 84 + 50 * triangle + 12);
    let count = (bytes.len() - 84) / 50;
    for at in (0..3 * count).map(|k| 84 + 50 * (k / 3) + 12 + 12 * (k % 3)) {
        let p = read(&bytes, at);
        let square: f32 = (0..3).map(|k| (p[k] - center[k]).powi(2)).sum();
        let share = (1.0 - square / radius.powi(2)).max(0.0).powi(2);
        for (k, direction) in [0.6, 0.0, 0.8].into_iter().enumerate() {
            let moved = p[k] + height * share * direction;
            bytes[at + 4 * k..at + 4 * k + 4].copy_from_slice(&moved.to_le_bytes());
        }
    }
    std::fs::write(shop.path(to), bytes).unwrap();
}

/// Stages that were run, and the parts of the fit that were found and made.
fn ran(shop: &Workshop, pipeline: &str) -> (Vec<String>, [u64; 2]) {
    let ended = shop.topipe(&["run", pipeline, "--json", "--jobs", "1"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let (mut stages, mut parts) = (Vec::new(), [0; 2]);
    for line in ended.stdout.lines() {
        let event: Value = serde_json::from_str(line).unwrap();
        match event["event"].as_str().unwrap() {
            "stage-finished" => stages.push(event["stage"].as_str().unwrap().to_owned()),
            "stage-units" => parts = ["reused", "computed"].map(|field| event[field].as_u64().unwrap()),
            "stage-warning" => assert!(!event.to_string().contains("laid out anew"), "{event}"),
            _ => {}
        }
    }
    stages.sort();
    (stages, parts)
}

#[test]
fn an_edit_of_the_mesh_costs_what_it_touches() {
    let shop = y_form();
    bump(&shop, "arm.stl", "rib.stl", 1200, 4.0, 0.3);
    let edited = shop.topipe(&["edit", "arm.toml", "rib.stl"]);
    assert_eq!(edited.code, 0, "{}", edited.stderr);
    assert!(edited.stdout.contains("topipe run rib.toml"), "{}", edited.stdout);
    let plan = shop.topipe(&["plan", "rib.toml"]).stdout;
    let is_cached = |stage: &str| {
        let line = plan.lines().find(|line| line.split_whitespace().next() == Some(stage));
        line.is_some_and(|line| line.ends_with("cached"))
    };
    assert!(["mesh-1", "smooth-1", "tiles-1", "quads-1"].into_iter().all(is_cached), "{plan}");
    let (stages, [reused, computed]) = ran(&shop, "rib.toml");
    assert_eq!(stages, ["beams", "check", "frame", "mesh", "quads", "smooth", "surface"]);
    assert!(computed > 0 && 3 * computed < reused, "{computed} computed, {reused} reused");
    assert!(shop.read("topipe-out/rib/arm.step").starts_with("ISO-10303-21"));
    let report: Value = serde_json::from_str(&shop.read("topipe-out/rib/report.json")).unwrap();
    assert_eq!(report["surface"]["closed"], true);
    assert!(report["surface"]["gap_mm"].as_f64().unwrap() < 1e-6);
    assert!(report["smoothing"]["kept_vertices"].as_u64().unwrap() > 1000);
    assert!(report["smoothing"]["volume_error"].as_f64().unwrap().abs() < 1e-3);

    // An edit of what was edited: its layout is carried over without a tiling of its own.
    bump(&shop, "rib.stl", "boss.stl", 300, 4.0, 0.3);
    assert_eq!(shop.topipe(&["edit", "rib.toml", "boss.stl", "-o", "third.toml"]).code, 0);
    let spec = shop.read("third.toml");
    assert!(spec.contains("earlier_layout = \"quads-2\"") && spec.contains("earlier_layout = \"quads-1\""));
    let (stages, [reused, computed]) = ran(&shop, "third.toml");
    assert_eq!(stages, ["beams", "check", "frame", "mesh", "quads", "smooth", "surface"]);
    assert!(computed > 0 && 3 * computed < reused, "{computed} computed, {reused} reused");
}

/// The edited file has its triangles in another order, one of them divided, and no labels of its own.
#[test]
fn an_edited_mesh_may_have_other_triangles() {
    let shop = Workshop::with_part("y-form", "");
    std::fs::rename(shop.path("part.stl"), shop.path("arm.stl")).unwrap();
    let labels = format!("{}/../../fixtures/y-form/y-form.labels.csv", env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(labels, shop.path("arm.csv")).unwrap();
    assert_eq!(shop.topipe(&["new", "arm.stl"]).code, 0);
    let spec = shop.read("arm.toml");
    let labelled = spec.replace("path = \"arm.stl\"", "path = \"arm.stl\"\nlabels = \"arm.csv\"");
    assert_ne!(spec, labelled);
    shop.write("arm.toml", &labelled);
    let run = shop.topipe(&["run", "arm.toml"]);
    assert_eq!(run.code, 0, "{}", run.stderr);

    bump(&shop, "arm.stl", "rib.stl", 1200, 4.0, 0.3);
    let bytes = std::fs::read(shop.path("rib.stl")).unwrap();
    let mut records: Vec<Vec<u8>> = bytes[84..].chunks(50).map(<[u8]>::to_vec).collect();
    let corner = |record: &[u8], k: usize| -> [f32; 3] {
        [0, 1, 2].map(|axis| {
            let at = 12 + 12 * k + 4 * axis;
            f32::from_le_bytes(record[at..at + 4].try_into().unwrap())
        })
    };
    let whole = records.remove(1200);
    let corners = [0, 1, 2].map(|k| corner(&whole, k));
    let middle = [0, 1, 2].map(|axis| corners.iter().map(|p| p[axis] / 3.0).sum::<f32>());
    for k in 0..3 {
        let mut piece = whole.clone();
        let at = 12 + 12 * k;
        for (axis, x) in middle.iter().enumerate() {
            piece[at + 4 * axis..at + 4 * axis + 4].copy_from_slice(&x.to_le_bytes());
        }
        records.push(piece);
    }
    records.reverse();
    let mut edited = bytes[..80].to_vec();
    edited.extend((records.len() as u32).to_le_bytes());
    records.iter().for_each(|record| edited.extend(record));
    std::fs::write(shop.path("rib.stl"), edited).unwrap();

    assert_eq!(shop.topipe(&["edit", "arm.toml", "rib.stl"]).code, 0);
    let spec = shop.read("rib.toml");
    assert!(spec.contains("earlier = \"mesh-1\"") && spec.matches("arm.csv").count() == 1, "{spec}");
    let (_, [reused, computed]) = ran(&shop, "rib.toml");
    assert!(computed > 0 && 3 * computed < reused, "{computed} computed, {reused} reused");
    let report = |name: &str| -> Value {
        serde_json::from_str(&shop.read(&format!("topipe-out/{name}/report.json"))).unwrap()
    };
    let [before, now] = ["arm", "rib"].map(report);
    assert_eq!(now["surface"]["closed"], true);
    assert!(now["smoothing"]["volume_error"].as_f64().unwrap().abs() < 1e-12);
    // As many vertices of non-design faces are held as before.
    let frozen = |report: &Value| report["smoothing"]["frozen_vertices"].as_u64().unwrap();
    assert!(frozen(&now) > 500 && frozen(&now).abs_diff(frozen(&before)) < 10);

    // Once more: labels still come from the first file.
    bump(&shop, "rib.stl", "boss.stl", 300, 4.0, 0.3);
    assert_eq!(shop.topipe(&["edit", "rib.toml", "boss.stl"]).code, 0);
    let (_, [reused, computed]) = ran(&shop, "boss.toml");
    assert!(computed > 0 && 3 * computed < reused, "{computed} computed, {reused} reused");
    // Both are one too many.
    let twice = spec.replace("earlier = \"mesh-1\"", "earlier = \"mesh-1\"\nlabels = \"arm.csv\"");
    shop.write("rib.toml", &twice);
    let run = shop.topipe(&["run", "rib.toml"]);
    assert!(run.code == 2 && run.stderr.contains("name one"), "{}", run.stderr);
}

#[test]
fn an_edit_of_nothing_costs_nothing() {
    let shop = y_form();
    assert_eq!(shop.topipe(&["edit", "arm.toml"]).code, 0);
    // The mesh is the same, and so are the points and the patches.
    let (stages, [reused, computed]) = ran(&shop, "arm-edited.toml");
    assert_eq!(stages, ["beams", "check", "frame", "quads", "smooth", "surface"]);
    assert_eq!(computed, 0, "{reused} reused");
    assert_eq!(shop.read("topipe-out/arm-edited/arm.step"), shop.read("topipe-out/arm/arm.step"));
}

#[test]
fn what_can_not_be_edited_is_said() {
    let shop = Workshop::new();
    let refused = |arguments: &[&str], code: i32, words: &[&str]| {
        let ended = shop.topipe(&[&["edit"], arguments].concat());
        assert_eq!(ended.code, code, "{arguments:?}: {}", ended.stderr);
        assert!(words.iter().all(|word| ended.stderr.contains(word)), "{arguments:?}: {}", ended.stderr);
    };
    refused(&["box.toml"], 2, &["box.toml", "not one layout"]);
    refused(&["none.toml"], 2, &["there is no pipeline none.toml"]);
    refused(&["box.off"], 2, &["is a mesh, not a pipeline"]);
    assert_eq!(shop.topipe(&["new", "box.off", "-o", "part.toml"]).code, 0);
    refused(&["part.toml", "none.stl"], 2, &["there is no mesh none.stl"]);
    refused(&["part.toml", "-o", "part.toml"], 2, &["part.toml exists", "--overwrite"]);
    std::fs::create_dir(shop.path("below")).unwrap();
    refused(&["part.toml", "-o", "below/part.toml"], 2, &["not in the folder of part.toml"]);
    // Nothing was written.
    assert!(!shop.path("part-edited.toml").exists() && !shop.path("below/part.toml").exists());
    // One of two belonging together.
    assert_eq!(shop.topipe(&["edit", "part.toml"]).code, 0);
    let spec = shop.read("part-edited.toml");
    shop.write("part-edited.toml", &spec.replace("earlier_input = \"mesh-1\"\n", ""));
    let run = shop.topipe(&["run", "part-edited.toml"]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    assert!(run.stderr.contains("`earlier` and `earlier_input` belong together"), "{}", run.stderr);
}
