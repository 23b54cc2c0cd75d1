//! `report.html`, the file about the run.

use crate::workshop::{NOTHING, Workshop, files_below};

/// The pipeline with a report of its run.
fn with_report() -> Workshop {
    let shop = Workshop::new();
    shop.edit("\"report.json\" = \"check\"", "\"report.json\" = \"check\"\n\"report.html\" = \"check\"");
    shop
}

#[test]
fn the_report_is_written_when_what_it_shows_has_changed() {
    let shop = with_report();
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(ended.stdout.contains("report.html  written; open it"), "{}", ended.stdout);
    let page = shop.read("topipe-out/box/report.html");
    for part in [
        "<title>box",
        "Volume of the smoothed mesh",
        "id=\"scene\"",
        "smooth",
        "CAD surface: not in this report",
    ] {
        assert!(page.contains(part), "no {part}");
    }
    // The mesh before and after, for those who print it or allow no scripts.
    assert_eq!(page.matches("<img src=\"data:image/png;base64,iVBORw0KGgo").count(), 2);
    // It is no export of the run: the record of a run cannot hold a file that shows the record.
    assert!(!shop.read("topipe-out/box/run.json").contains("report.html"));
    assert_eq!(shop.events(&[]), NOTHING);
    assert_eq!(
        shop.read("topipe-out/box/report.html"),
        page,
        "the times in it are still those of the first run"
    );
    shop.write("topipe-out/box/report.html", &page[..page.len() / 2]);
    shop.events(&[]);
    assert!(shop.read("topipe-out/box/report.html").ends_with("</html>"));
    shop.edit("method = \"taubin\"", "method = \"taubin\"\nlambda = 0.5");
    shop.events(&[]);
    assert_ne!(shop.read("topipe-out/box/report.html"), page);
    // And by hand, from the record.
    let by_hand = shop.topipe(&["report", "topipe-out/box", "-o", "mail/box.html"]);
    assert_eq!(by_hand.code, 0, "{}", by_hand.stderr);
    assert!(shop.read("mail/box.html").contains("<title>box"));
    assert_eq!(shop.topipe(&["report", "nowhere"]).code, 2);
    // With a cache that has none of the results, and then with the one that has them, over the same file.
    let record = ["report", "topipe-out/box/run.json", "-o", "mail/again.html"];
    assert_eq!(shop.topipe(&[&record[..], &["--cache", "empty"]].concat()).code, 0);
    let without = shop.read("mail/again.html");
    assert_eq!(shop.topipe(&record).code, 0);
    let with = shop.read("mail/again.html");
    assert!(with.len() > without.len(), "{} with the results, {} without", with.len(), without.len());
    assert_eq!(shop.topipe(&[&record[..], &["--cache", "empty"]].concat()).code, 0);
    assert_eq!(shop.read("mail/again.html").len(), without.len());
}

#[test]
fn a_run_that_failed_has_a_report_of_what_there_is() {
    let shop = with_report();
    shop.events(&[]);
    // The mesh is known; smoothing is told to hold a hole where there is none.
    shop.edit("detect_planes = false", "features = [{ action = \"pin\", space = { type = \"box\", min = [90.0, 90.0, 90.0], max = [91.0, 91.0, 91.0] } }]");
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    let page = shop.read("topipe-out/box/report.html");
    for part in [
        "The run did not finish",
        "Stage smooth failed",
        "skipped",
        "The report of stage check is missing",
        // Its figures are measured on what there is: the mesh, and nothing else.
        "measured for this page, on the results there are",
        "Volume enclosed by the mesh",
        "Smoothed mesh: not in this report",
    ] {
        assert!(page.contains(part), "no {part}");
    }
    assert!(!page.contains("Volume of the smoothed mesh"));
    // Of the mesh there is a picture all the same.
    assert!(page.contains("\"id\":\"original\""));
}

/// The whole chain, with a limit that no surface keeps.
#[test]
fn a_run_that_breaks_a_required_limit_has_a_report_with_the_figure() {
    let shop = with_report();
    let beyond = "\n[stage.tiles]\nkind = \"tiling\"\ninput = \"smooth\"\n\
        [stage.quads]\nkind = \"quad-matching\"\ninput = \"tiles\"\n\
        [stage.surface]\nkind = \"spline-fit\"\ninput = \"quads\"\n";
    shop.edit(
        "mesh = \"smooth\"",
        "mesh = \"smooth\"\nsurface = \"surface\"\nmax_deviation_mm = 1e-9\nrequire = true",
    );
    shop.write("box.toml", &(shop.read("box.toml") + beyond));
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 1, "{}", ended.stderr);
    assert!(ended.stderr.contains("surface.deviation.max_mm is"), "{}", ended.stderr);
    assert!(ended.stdout.contains("report.html  written; open it"), "{}", ended.stdout);
    let page = shop.read("topipe-out/box/report.html");
    for part in [
        "The run did not finish; <a href=\"#figures\">",
        "Stage check failed: ",
        "measured for this page, on the results there are",
        "Volume of the CAD solid",
        "Figure with a limit",
        "at most 1.00e-9",
    ] {
        assert!(page.contains(part), "no {part}");
    }
    // Nothing has changed since: the file is not written again.
    let again = shop.topipe(&["run", "box.toml"]);
    assert_eq!(again.code, 1);
    assert!(again.stdout.contains("report.html  up to date; open it"), "{}", again.stdout);
}

#[test]
fn each_variant_of_a_sweep_has_its_report() {
    let shop = with_report();
    shop.write(
        "box.toml",
        &(shop.read("box.toml") + "\n[sweep]\ngrid = { \"smooth.iterations\" = [2, 4] }\n"),
    );
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let mut pages: Vec<String> = Vec::new();
    for file in files_below(&shop.path("topipe-out/box")) {
        if file.ends_with("report.html") {
            pages.push(std::fs::read_to_string(file).unwrap());
        }
    }
    assert_eq!(pages.len(), 2);
    // Three stages in each, though the run has five.
    assert!(pages.iter().all(|page| page.matches("class=\"state computed\"").count() == 3));
}
