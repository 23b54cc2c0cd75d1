//! 3MF core (3MF Consortium, *3D Manufacturing Format, Core Specification* 1.3): one object, in millimetres.

use crate::{Model, escape};
use std::fmt::Write as _;
use std::io::{self, Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>
"#;

const RELATIONS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>
"#;

/// Writes `model` as `.3mf`. Coordinates are written so that they read back to the same f64.
pub fn three_mf(model: &Model<'_>, out: &mut impl Write) -> io::Result<()> {
    model.check()?;
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"millimeter\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\n\
         <metadata name=\"Application\">topipe</metadata>\n<resources>\n<object id=\"1\" type=\"model\" name=\"{}\">\n<mesh>\n<vertices>\n",
        escape(model.name)
    );
    // Writing to a string does not fail.
    for p in &model.mesh.positions {
        let _ = writeln!(text, "<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>", p.x, p.y, p.z);
    }
    text += "</vertices>\n<triangles>\n";
    for [a, b, c] in &model.mesh.triangles {
        let _ = writeln!(text, "<triangle v1=\"{}\" v2=\"{}\" v3=\"{}\"/>", a.0, b.0, c.0);
    }
    text += "</triangles>\n</mesh>\n</object>\n</resources>\n<build>\n<item objectid=\"1\"/>\n</build>\n</model>\n";

    // The default time of an entry is fixed, so the bytes are too.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(zip::DateTime::default());
    let mut package = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in
        [("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS), ("3D/3dmodel.model", text.as_str())]
    {
        package.start_file(name, options)?;
        package.write_all(content.as_bytes())?;
    }
    out.write_all(&package.finish()?.into_inner())
}
