import pytest
from conftest import model_of


@pytest.mark.parametrize(("name", "counts"), [("puma", (60, 49, 36)), ("hexaglide", (70, 70, 64))])
def test_counts_of_all_affecting_and_base_parameters(name, counts, request):
    model = request.getfixturevalue(name)
    assert (model.values.size, model.affecting.sum(), model.base.columns.size) == counts


def test_regrouping_relations_follow_khalil(puma):
    # Rules of Khalil and Gautier for revolute joints, with the lengths of this arm.
    texts = {text.split()[0]: text for text in puma.base.expressions}
    assert texts["Izz_6"] == "Izz_6"
    assert texts["Ixx_6"] == "Ixx_6 - Iyy_6"
    assert texts["my_5"] == "my_5 - mz_6"
    assert texts["mx_2"] == "mx_2 + a_3 m_3 + a_3 m_4 + a_3 m_5 + a_3 m_6"
    assert texts["mx_3"] == "mx_3 + a_4 m_4 + a_4 m_5 + a_4 m_6"
    assert "- (a_4^2 - d_4^2) m_4" in texts["Ixx_3"]
    assert "+ (a_3^2 + d_3^2) m_3" in texts["Izz_1"]


def test_named_base_columns_come_first():
    model = model_of("puma560", "model.base_columns=[Iyy_2, mz_4]")
    names = [model.mechanism.parameter_names[k] for k in model.base.columns]
    assert names[:2] == ["Iyy_2", "mz_4"]
    assert len(names) == 36


def test_standard_deviation_as_nominal_torque():
    model = model_of("puma560", "nominal_torque=standard-deviation")
    assert not model.nominal_torque_given
    assert (model.nominal_torque > 0).all()
