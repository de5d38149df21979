"""The pairs of axes that carry one beam, as a cell file names them."""
