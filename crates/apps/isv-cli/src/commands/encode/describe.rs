//! The part of the command line that says what a take is.

use crate::cli_enums::MetadataName;
use isv::raw::take::encode::MetadataOptions;

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Description")]
pub(super) struct DescribeArgs {
    /// Title of the take, for people
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// What captured the take, for people
    #[arg(long, value_name = "TEXT")]
    capture_device: Option<String>,
    /// When to describe the take in the stream [default: auto]
    ///
    /// Title, device, unit, axes, colour space, what ingest decided and the settings; isv info shows them. A stream that describes
    /// itself has version 2 of the format. With auto, streams with colour and with a title or device do.
    #[arg(long, value_enum)]
    metadata: Option<MetadataName>,
}

impl DescribeArgs {
    /// Choices of the flags.
    pub(super) fn options(&self) -> MetadataOptions {
        MetadataOptions {
            choice: self.metadata.map(Into::into).unwrap_or_default(),
            title: self.title.clone(),
            device: self.capture_device.clone(),
        }
    }
}
