//! `topipe graph`.

use crate::args::{GraphArguments, GraphFormat};
use crate::failure::Failure;
use crate::stages::registry;
use std::fmt::Write;
use topipe_engine::{ExitCode, Pipeline};

pub(crate) fn run(arguments: &GraphArguments) -> Result<ExitCode, Failure> {
    let pipeline = super::pipeline::load(&arguments.pipeline, &[], &registry())?;
    super::print(&match arguments.format {
        GraphFormat::Mermaid => mermaid(&pipeline),
        GraphFormat::Dot => dot(&pipeline),
        GraphFormat::Svg => crate::diagram::of_pipeline(&pipeline),
    })
}

// Nodes are numbered: the names of stages may be words of the language. Edges carry the kind of the artifact.

fn mermaid(pipeline: &Pipeline) -> String {
    let mut text = "flowchart LR\n".to_owned();
    for (index, node) in pipeline.stages.iter().enumerate() {
        let _ = writeln!(text, "    s{index}[\"{}<br><i>{}</i>\"]", node.name, node.stage.kind());
    }
    for (index, export) in pipeline.exports.iter().enumerate() {
        let _ = writeln!(text, "    e{index}([\"{}\"])", export.file.replace('"', "#quot;"));
    }
    for (from, _, to) in pipeline.graph.edges() {
        let _ = writeln!(text, "    s{from} -->|{}| s{to}", pipeline.stages[from].stage.output().name);
    }
    for (index, export) in pipeline.exports.iter().enumerate() {
        let _ = writeln!(text, "    s{} -.-> e{index}", export.stage);
    }
    text
}

fn dot(pipeline: &Pipeline) -> String {
    let mut text = "digraph pipeline {\n    rankdir = LR;\n    node [shape = box];\n".to_owned();
    for (index, node) in pipeline.stages.iter().enumerate() {
        let _ = writeln!(text, "    s{index} [label = \"{}\\n{}\"];", node.name, node.stage.kind());
    }
    for (index, export) in pipeline.exports.iter().enumerate() {
        let file = export.file.replace('"', "\\\"");
        let _ = writeln!(text, "    e{index} [label = \"{file}\", shape = note];");
    }
    for (from, _, to) in pipeline.graph.edges() {
        let _ = writeln!(
            text,
            "    s{from} -> s{to} [label = \"{}\"];",
            pipeline.stages[from].stage.output().name
        );
    }
    for (index, export) in pipeline.exports.iter().enumerate() {
        let _ = writeln!(text, "    s{} -> e{index} [style = dashed];", export.stage);
    }
    text + "}\n"
}
