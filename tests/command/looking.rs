//! Looking at pipelines, meshes and results.

use crate::workshop::Workshop;

#[test]
fn graphs_name_stages_and_exports() {
    let shop = Workshop::new();
    let mermaid = shop.topipe(&["graph", "box.toml"]).stdout;
    assert!(mermaid.starts_with("flowchart LR\n") && mermaid.contains("s0 -->|mesh| s1"), "{mermaid}");
    let dot = shop.topipe(&["graph", "box.toml", "--format", "dot"]).stdout;
    assert!(dot.starts_with("digraph") && dot.contains("label = \"report.json\""), "{dot}");
    let svg = shop.topipe(&["graph", "box.toml", "--format", "svg"]).stdout;
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{svg}");
    // Three stages and three exports, each with its box.
    assert_eq!(svg.matches("rx=").count(), 6, "{svg}");
}

#[test]
fn inspect_tells_what_is_in_a_mesh_and_in_a_result() {
    let shop = Workshop::new();
    let mesh = shop.topipe(&["inspect", "box.off"]).stdout;
    assert!(mesh.contains("432 triangles, 218 vertices") && mesh.contains("genus 0"), "{mesh}");
    assert_eq!(shop.topipe(&["inspect", "smooth", "--pipeline", "box.toml"]).code, 4);
    shop.events(&[]);
    let result = shop.topipe(&["inspect", "smooth", "--pipeline", "box.toml"]);
    assert!(result.stdout.starts_with("mesh (version 3), "), "{result:?}");
    assert_eq!(shop.topipe(&["inspect", "smoth", "--pipeline", "box.toml"]).code, 2);
}

#[test]
fn edges_are_listed_with_the_box_that_names_them() {
    let shop = Workshop::new();
    shop.edit("method = \"taubin\"\ndetect_planes = false", "iterations = 0");
    shop.edit("\"smooth.ply\" = \"smooth\"", "\"features.csv\" = \"smooth\"");
    let edges = || {
        let ended = shop.topipe(&["run", "box.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let text = shop.topipe(&["inspect", "smooth", "--pipeline", "box.toml"]).stdout;
        text.lines().filter(|l| l.starts_with("edge ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let all = edges();
    assert_eq!(all.len(), 12, "{all:?}");
    let row = "sharp, 6 edge(s), 3.00 mm, dihedral angle at most 90.00 degrees, \
               from [0.000, 0.000, 0.000] to [3.000, 0.000, 0.000] mm";
    assert!(all[..4].iter().any(|l| l.ends_with(row)), "{all:?}");
    let csv = shop.read("topipe-out/box/features.csv");
    assert!(csv.contains("\n,edge,,,,,,,,,,,0,0,0,3,0,0,6,3,90,sharp\n"), "{csv}");
    let space = "{ type = \"box\", min = [0, 0, 0], max = [3, 0, 0] }";
    let drop = format!("features = [{{ action = \"drop\", shape = \"edge\", space = {space} }}]");
    shop.edit("iterations = 0", &format!("iterations = 0\n{drop}"));
    let fewer = edges();
    assert!(fewer.len() == 11 && !fewer.iter().any(|l| l.ends_with(row)), "{fewer:?}");
}

#[test]
fn results_and_meshes_can_be_drawn() {
    let shop = Workshop::new();
    shop.edit("\"smooth.ply\" = \"smooth\"", "\"smooth.png\" = \"smooth\"");
    assert_eq!(shop.topipe(&["run", "box.toml"]).code, 0);
    let small = ["--size", "60x40"];
    let drawn = shop.topipe(&[&["render", "box.off", "-o", "box.png"][..], &small].concat());
    assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    let stage = ["render", "smooth", "--pipeline", "box.toml", "--view", "-30:20", "-o", "stage.png"];
    assert_eq!(shop.topipe(&[&stage[..], &small].concat()).code, 0);
    for (file, width) in [("topipe-out/box/smooth.png", 1200), ("box.png", 60), ("stage.png", 60)] {
        let png = std::fs::read(shop.path(file)).unwrap();
        assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
        assert_eq!(png[16..20], u32::to_be_bytes(width));
    }
    // Colours by number, with a legend and a bar of known length, the same each time.
    let deviation = [
        "render",
        "smooth",
        "--pipeline",
        "box.toml",
        "--color",
        "deviation",
        "--against",
        "mesh",
        "--scale-bar",
        "--edges",
        "--size",
        "200x150",
        "-o",
    ];
    for name in ["one.png", "two.png"] {
        let drawn = shop.topipe(&[&deviation[..], &[name]].concat());
        assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    }
    assert_eq!(std::fs::read(shop.path("one.png")).unwrap(), std::fs::read(shop.path("two.png")).unwrap());
    for color in ["plain", "regions", "design", "kinds", "curvature"] {
        let drawn =
            shop.topipe(&["render", "box.off", "--color", color, "--size", "60x40", "-o", "color.png"]);
        assert_eq!(drawn.code, 0, "{color}: {}", drawn.stderr);
    }
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--color", "deviation"]).code, 2);
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--color", "pink"]).code, 2);
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--view", "inside"]).code, 2);
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--size", "0x0"]).code, 2);
}

#[test]
fn meshes_are_written_in_all_formats_with_the_same_bytes() {
    let endings = ["glb", "3mf", "vtp", "vtk", "inp"];
    let write = || {
        let shop = Workshop::new();
        let exports: Vec<String> = endings.iter().map(|e| format!("\"smooth.{e}\" = \"smooth\"")).collect();
        shop.edit("\"smooth.ply\" = \"smooth\"", &exports.join("\n"));
        let ended = shop.topipe(&["run", "box.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        endings.map(|ending| std::fs::read(shop.path(&format!("topipe-out/box/smooth.{ending}"))).unwrap())
    };
    let files = write();
    let starts: [&[u8]; 5] = [b"glTF", b"PK\x03\x04", b"<?xml", b"# vtk", b"*HEADING"];
    for ((file, start), ending) in files.iter().zip(starts).zip(endings) {
        assert!(file.starts_with(start), "{ending}");
    }
    assert_eq!(files, write());
}

#[test]
fn what_a_stage_said_can_be_read_again() {
    let shop = Workshop::new();
    assert!(shop.topipe(&["log", "box.toml"]).stdout.contains("mesh: no result in the cache"));
    shop.topipe(&["run", "box.toml"]);
    let log = shop.topipe(&["log", "box.toml", "mesh"]).stdout;
    // The box is given in squares.
    let remark = log.lines().nth(1).unwrap();
    assert!(remark.starts_with("mesh: "), "{log}");
    let again = shop.topipe(&["run", "box.toml", "-v"]).stderr;
    assert!(again.contains(remark), "no `{remark}` in\n{again}");
}

/// A mesh with faces that are turned the other way.
#[test]
fn a_repaired_mesh_is_warned_of_unless_the_run_is_quiet() {
    let shop = Workshop::new();
    let fin = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/zoo/mixed-orientation.off");
    std::fs::copy(fin, shop.path("box.off")).unwrap();
    let warning = "warning: mesh: box.off was repaired: turned faces to agree with their neighbours: ";
    let until = |more: &[&str]| {
        let arguments = [&["run", "box.toml", "--until", "mesh"], more].concat();
        shop.topipe(&arguments).stderr
    };
    assert!(until(&[]).starts_with(warning), "{}", until(&[]));
    // From the cache as well.
    assert!(until(&[]).starts_with(warning));
    assert_eq!(until(&["--quiet"]), "");
    let log = shop.topipe(&["log", "box.toml", "mesh"]).stdout;
    assert!(log.contains("mesh: warning: box.off was repaired: "), "{log}");
}
