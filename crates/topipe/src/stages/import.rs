//! `kind = "import"`.

use crate::artifacts::Mesh;
use std::collections::BTreeMap;
use topipe_engine::{FileField, InputPort, Stage, StageContext, StageError};
use topipe_mesh::import::{ImportError, ImportOptions, NonDesignRegion, Source, read_source};

/// Reads a mesh file.
pub(super) struct Import;

impl Stage for Import {
    type Parameters = ImportOptions;
    type Output = Mesh;
    const KIND: &'static str = "import";
    const SUMMARY: &'static str = "Reads an STL, OFF, OBJ, PLY, VTU, VTI, VTK or INP file, repairs what can be repaired, and labels its faces.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_IMPORT").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::optional::<Mesh>(
            "earlier",
            "An earlier version of the mesh: faces have the labels that they have there.",
        )]
    }

    fn files(&self) -> Vec<FileField> {
        vec![
            FileField { name: "path", optional: false, doc: "The mesh file, relative to the pipeline." },
            FileField {
                name: "labels",
                optional: true,
                doc: "A file with one 0 or 1 per face of the mesh file, in its order; 1 is non-design.",
            },
        ]
    }

    fn nested_files(&self, options: &ImportOptions) -> Vec<String> {
        let is_stl = |region: &NonDesignRegion| matches!(region, NonDesignRegion::Stl { .. });
        (0..options.non_design.len())
            .filter(|&k| is_stl(&options.non_design[k]))
            .map(|k| format!("/non_design/{k}/path"))
            .collect()
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        options: &ImportOptions,
    ) -> Result<topipe_mesh::Part, StageError> {
        let mesh = context.file("path").ok_or_else(|| StageError::Failed("`path` was not read".into()))?;
        let mut region_files: BTreeMap<String, &[u8]> = BTreeMap::new();
        for (pointer, path) in self.nested_files(options).iter().zip(options.region_files()) {
            if let Some(file) = context.file(pointer) {
                region_files.insert(path.to_owned(), &file.bytes);
            }
        }
        let labels = context.file("labels").map(|file| (file.name.as_str(), &*file.bytes));
        let earlier = context.optional_input::<Mesh>("earlier")?;
        if labels.is_some() && earlier.is_some() {
            let message = "`labels` says which faces are non-design, and `earlier` does too: name one";
            return Err(StageError::BadParameter(message.into()));
        }
        let earlier = earlier.as_deref();
        let source = Source { name: &mesh.name, bytes: &mesh.bytes, labels, earlier, region_files };
        let part = read_source(&source, options, context.progress()).map_err(|error| match error {
            ImportError::Interrupted(_) => StageError::Interrupted,
            ImportError::Option { .. } => StageError::BadParameter(error.to_string()),
            error => StageError::Refused(error.to_string()),
        })?;
        let (mended, reread): (Vec<_>, Vec<_>) =
            part.import.repairs.iter().partition(|repair| repair.is_of_the_surface());
        if !mended.is_empty() {
            let mended: Vec<String> =
                mended.iter().map(|repair| format!("{}: {}", repair.what, repair.count)).collect();
            context.progress().warn(&format!("{} was repaired: {}", mesh.name, mended.join("; ")));
        }
        for repair in reread {
            context.progress().remark(&format!("{}: {}", repair.what, repair.count));
        }
        Ok(part)
    }
}
