"""Settings of nbconvert for the site: it reads them because docs/notebook_pages.py says where they are."""

c = get_config()  # noqa: F821 - nbconvert gives it

# A widget would need scripts from elsewhere, and a kernel: a page shows the picture that stands for it.
c.NbConvertBase.display_data_priority = ["text/html", "image/svg+xml", "image/png", "text/markdown", "text/plain"]
c.ClearMetadataPreprocessor.enabled = True
c.ClearMetadataPreprocessor.clear_cell_metadata = False
c.ClearMetadataPreprocessor.preserve_nb_metadata_mask = {"kernelspec", "language_info"}
