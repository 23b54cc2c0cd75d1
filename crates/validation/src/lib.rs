//! Every figure of report.json, computed from artifacts alone.
