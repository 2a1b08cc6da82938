"""Settings of nbconvert for the site; docs/notebook_pages.py adds this folder to its search path."""

c = get_config()  # noqa: F821 - defined by nbconvert

# A widget would need external scripts and a kernel: a page shows its picture instead.
c.NbConvertBase.display_data_priority = ["text/html", "image/svg+xml", "image/png", "text/markdown", "text/plain"]
c.ClearMetadataPreprocessor.enabled = True
c.ClearMetadataPreprocessor.clear_cell_metadata = False
c.ClearMetadataPreprocessor.preserve_nb_metadata_mask = {"kernelspec", "language_info"}
