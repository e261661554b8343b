"""The icon of each model, and the script that draws them: python -m fmus.packaging.icons"""
