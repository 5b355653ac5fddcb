"""How results are said and shown: values in the units of the files in, words, tables and colours out."""
